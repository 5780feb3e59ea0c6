/** A worker's bundled source text; the build resolves it (scripts/build.mjs). */
declare module "worker:*" {
  const code: string;
  export default code;
}
