/** Runs in the page: what the tests call. map3d is the global of dist/map3d.js. */
import type * as M from "../../src/map3d";

/** A bare page with the canvas of the listing. */
export const BARE = '<!doctype html><html><head><meta charset="utf-8"><title>test</title><link rel="icon" href="data:,"><link rel="stylesheet" href="/bare.css"></head><body><canvas id="mapcanvas"></canvas><script src="/map3d.js"></script></body></html>';

export interface Started {
  map: M.map;
  layer: M.imageLayer;
}

export type Global = typeof globalThis & Started & { errors: string[]; clicks: M.ClickEvent[]; map3d: typeof M };
