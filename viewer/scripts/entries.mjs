/** Optional bundles `map3d-<name>` and their source files. `map3d-full` contains the core and all of them. */
export const ENTRIES = {
  cluster: "src/cluster/index.ts",
  compare: "src/compare/index.ts",
  controls: "src/controls/index.ts",
  debug: "src/debug/index.ts",
  element: "src/element/index.ts",
  files: "src/files/index.ts",
  geojson: "src/geojson/index.ts",
  measure: "src/measure/index.ts",
  model: "src/model/index.ts",
  offline: "src/offline/index.ts",
  orbit: "src/orbit/index.ts",
  portrayal: "src/portrayal/index.ts",
  print: "src/print/index.ts",
  shade: "src/shade/index.ts",
  theme: "src/theme/index.ts",
};
