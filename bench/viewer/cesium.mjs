// Builds the files for the page of CesiumJS.
import { join } from "node:path";
import { build } from "../../viewer/node_modules/esbuild/lib/main.js";

const here = import.meta.dirname;
export const modules = join(here, "node_modules");

/** Builds the library without unused code. */
export const buildCesium = (work) => build({ entryPoints: [join(here, "pages/cesium.entry.js")], bundle: true, minify: true, format: "iife", globalName: "Cesium", outfile: join(work, "built/cesium.js"), logLevel: "error" });

/** Folder by first part of the path: pages, library, and the 3D Tiles in `work`. */
export const roots = (work) => ({ pages: join(here, "pages"), "3dtiles": join(work, "3dtiles"), cesium: join(modules, "cesium/Build/Cesium"), built: join(work, "built") });
