/** Bundles beside the core, `map3d-<name>`: what each exports. `map3d-full` has the core and all of them. */
export const ENTRIES = {
  element: "src/element/index.ts",
  measure: "src/measure/index.ts",
  theme: "src/theme/index.ts",
};
