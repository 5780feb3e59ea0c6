/** The bundled source text of a worker, resolved by the build (scripts/build.mjs). */
declare module "worker:*" {
  const code: string;
  export default code;
}
