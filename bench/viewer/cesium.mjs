// What the page of CesiumJS needs besides a Server.
import { join } from "node:path";
import { build } from "../../viewer/node_modules/esbuild/lib/main.js";

const here = import.meta.dirname;
export const modules = join(here, "node_modules");

/** Bundles the library without what the page does not use. */
export const bundled = (work) => build({ entryPoints: [join(here, "pages/cesium.entry.js")], bundle: true, minify: true, format: "iife", globalName: "Cesium", outfile: join(work, "built/cesium.js"), logLevel: "error" });

/** First part of a path → folder: pages, library, and the 3D Tiles in `work`. */
export const roots = (work) => ({ pages: join(here, "pages"), "3dtiles": join(work, "3dtiles"), cesium: join(modules, "cesium/Build/Cesium"), built: join(work, "built") });
