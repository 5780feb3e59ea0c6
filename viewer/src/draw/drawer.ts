import type { Vec2 } from "../core/vec";
import type { Camera } from "../geo/camera";
import type { Frame, Tile } from "../geo/frame";
import type { LayerKind } from "../geo/manifest";
import type { Light } from "../geo/light";
import type { Shadow } from "../geo/shadows";
import type { TileData } from "../tiles/tileData";
import type { Rgb } from "./color";
import type { Clip, DepthMapping } from "./depthMapping";
import type { DrawStyles } from "./drawStyle";
import type { LightEstimator } from "./lightEstimator";

/** How a layer is shown: lit colour, colour or picture as stored, or a data layer in false colours. */
export type Mode = "lit" | "color" | "picture" | "normal" | "id" | "depth";
export const MODES: readonly Mode[] = ["lit", "color", "picture", "normal", "id", "depth"];

/** A rectangle of the screen and the tile whose pixels fill it. Device pixels, y down; quads of a pass are disjoint. */
export interface Quad {
  readonly from: Tile;
  /** Left, top, right, bottom. */
  readonly rect: readonly [number, number, number, number];
  /** Where the tile's own left top corner lies. */
  readonly origin: readonly [number, number];
  /** Texels a device pixel. */
  readonly scale: number;
}

/** Access to the tiles in memory. */
export interface TileAccess {
  /** Unique name of the tile's data in the cache. */
  key(kind: LayerKind, tile: Tile): string;
  /** null: empty, or kept by the drawer; undefined: not in memory. */
  data(kind: LayerKind, tile: Tile): TileData | null | undefined;
  /** The drawer has its own copy: ours need not be kept. */
  onUploaded(kind: LayerKind, tile: Tile): void;
}

/** One image layer in a frame. */
export interface Pass {
  readonly mode: Mode;
  /** The one whose tile pixels are nearest in size to device pixels; quads are of this level or stand in for it. */
  readonly level: number;
  readonly quads: readonly Quad[];
  readonly tiles: TileAccess;
  /** Colours by object id. */
  readonly highlight: ReadonlyMap<number, Rgb>;
  /** How objects are shown; null: all as they are. */
  readonly drawStyles: DrawStyles | null;
  /** Light that was rendered; drawn where its tiles are here. */
  readonly bakedLight: BakedLight;
  /** True when colour has no alpha, so that the id layer says what is covered. */
  readonly masked: boolean;
  readonly opacity: number;
  /** null: it is painted over what was painted before, whatever lies nearer. */
  readonly depths: DepthMapping | null;
  /** Where its depths lie, alone or with others; null: it has none. */
  readonly relief: DepthMapping | null;
  /** The part of the map that it is seen in. */
  readonly clip: Clip | null;
  /** Depth values that get the first and the last false colour. */
  readonly depthRange: readonly [number, number];
}

/** Rendered light that suits the present one. */
export interface BakedLight {
  readonly shadow: Shadow | null;
  readonly occlusion: boolean;
}

/** What a frame is painted of, and on. */
export interface FrameState {
  readonly camera: Camera;
  /** Device pixels. */
  readonly width: number;
  readonly height: number;
  /** Device pixels a CSS pixel. */
  readonly dpr: number;
  readonly light: Readonly<Light>;
}

/** Something that is not made of images, but seen among them by its depth. WebGL only. */
export interface CustomLayer {
  /** Least and greatest D, along a frame, of what it shows; null: it shows nothing. */
  getDepthRange(frame: Frame): Vec2 | null;
  /** Makes its pictures, before the frame is painted. Leaves the context's state as a new context has it, but for what uploads are unpacked by. @param range of D, of all that is painted */
  prerender(gl: WebGL2RenderingContext, setting: FrameState, range: Vec2): void;
  /** Paints what it has prepared into what is bound, premultiplied, with depth as a share of the range: pixels that it covers all; `soft`: the others. */
  render(gl: WebGL2RenderingContext, setting: FrameState, soft: boolean): void;
}

export interface FrameContent extends FrameState {
  readonly passes: readonly Pass[];
  readonly customLayers: readonly CustomLayer[];
  /** WebGL only: finds light that was not rendered; while the camera moves, what was found last does. */
  readonly lighting?: { readonly by: LightEstimator; readonly moving: boolean } | null;
  /** WebGL only: where to draw in place of the canvas, with the depth of all passes as a share of a range of D. */
  readonly target?: { readonly framebuffer: WebGLFramebuffer; readonly range: Vec2 };
}

export interface DrawerEvents {
  /** All that was drawn is gone; what the drawer had taken must be fetched anew. */
  lost(): void;
  restored(): void;
  /** Something that was still to be made is ready: a frame is needed. */
  changed(): void;
  failed(error: Error): void;
}

/** What paints a frame. It never asks for tiles itself, and for frames only by `changed`. */
export interface Drawer {
  readonly name: "webgl" | "canvas";
  /** What the picture is seen in: a canvas, or an element that holds some. */
  readonly element: HTMLElement;
  /** What was drawn last is not all: `changed` will be called. */
  readonly busy: boolean;
  /** null: it does not draw with WebGL. */
  readonly gl: WebGL2RenderingContext | null;
  /** What one who debugs should know; mostly empty. */
  readonly note: string;
  draw(frame: FrameContent): void;
  /** The tile has left the cache. */
  release(key: string): void;
  destroy(): void;
}

/** Layers without which a tile cannot be shown in a mode; `combined` by depth with others. */
export function listRequiredKinds(mode: Mode, masked: boolean, combined: boolean): LayerKind[] {
  const shown = listShownKinds(mode, masked);
  return combined && mode !== "depth" ? [...shown, "depth"] : shown;
}

function listShownKinds(mode: Mode, masked: boolean): LayerKind[] {
  if (mode === "lit") return masked ? ["color", "normal", "id"] : ["color", "normal"];
  if (mode === "color" || mode === "picture") return masked ? [mode, "id"] : [mode];
  return [mode];
}

/** Layers that a mode shows when they are here. */
export function listBakedLightKinds(mode: Mode, { shadow, occlusion }: BakedLight): LayerKind[] {
  if (mode !== "lit") return [];
  return [...(shadow ? [shadow.layer.kind as LayerKind] : []), ...(occlusion ? ["ao" as const] : [])];
}
