import { ENTRIES } from "./scripts/entries.mjs";

/** The API reference: all public names of the core and the entries, each documented. */
export default {
  name: "map3d.js",
  entryPoints: ["src/map3d.ts", ...Object.values(ENTRIES)],
  tsconfig: "tsconfig.json",
  out: "reference",
  readme: "README.md",
  excludeInternal: true,
  excludePrivate: true,
  excludeProtected: true,
  excludeExternals: true,
  disableSources: true,
  hideGenerator: true,
  // Types that are used only as parts of public types.
  intentionallyNotExported: ["CHANNELS", "GestureTarget", "OverlayEvents", "ImageLayerHost", "Camera", "Frame", "Rect", "Rgb", "DepthMapping", "DrawStyles", "Shadow", "FilledOptions", "GeographicJson", "SunJson", "ViewJson", "Occupancy", "ThreeNode", "ThreeRenderer", "ThreeTarget", "ThreeCamera", "ThreeRaycaster", "ThreeLight", "ThreeVector", "ThreeBox", "ThreeMixer"],
  // Fields need a comment only if their name and type are not enough.
  requiredToBeDocumented: ["Class", "Interface", "TypeAlias", "Function", "Variable", "Enum", "EnumMember", "Method", "Accessor"],
  validation: { notExported: true, invalidLink: true, invalidPath: false, rewrittenLink: true, notDocumented: true, unusedMergeModuleWith: true },
  treatWarningsAsErrors: true,
  treatValidationWarningsAsErrors: true,
  logLevel: "Warn",
};
