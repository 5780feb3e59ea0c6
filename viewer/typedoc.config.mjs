import { ENTRIES } from "./scripts/entries.mjs";

/** The reference: every public name of the core and of the entries, each with a sentence. */
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
  // Parts of public types that say enough where they are used.
  intentionallyNotExported: ["Steered", "SurfaceEvents", "Camera", "Frame", "Rect", "FilledOptions", "GeographicJson", "SunJson", "ViewJson", "Occupancy", "ThreeNode", "ThreeRenderer", "ThreeTarget", "ThreeCamera", "ThreeRaycaster", "Lamp", "Vector", "Box", "Mixer"],
  // Fields have a sentence where their name and type do not say it all.
  requiredToBeDocumented: ["Class", "Interface", "TypeAlias", "Function", "Variable", "Enum", "EnumMember", "Method", "Accessor"],
  validation: { notExported: true, invalidLink: true, invalidPath: false, rewrittenLink: true, notDocumented: true, unusedMergeModuleWith: true },
  treatWarningsAsErrors: true,
  treatValidationWarningsAsErrors: true,
  logLevel: "Warn",
};
