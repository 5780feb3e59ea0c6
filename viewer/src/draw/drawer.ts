import type { Vec2 } from "../core/vec";
import type { Camera } from "../geo/camera";
import type { Frame, Tile } from "../geo/frame";
import type { Light } from "../geo/light";
import type { Shadow } from "../geo/shadows";
import type { LayerKind, TileData } from "../tiles/tileData";
import type { Rgb } from "./color";
import type { Clip, DepthMapping } from "./depthMapping";
import type { DrawStyles } from "./drawStyle";
import type { LightEstimator } from "./lightEstimator";

/** The content of a layer: lit colour, colour or picture as stored, or a data layer in false colours. */
export type Mode = "lit" | "color" | "picture" | "normal" | "id" | "depth";
export const MODES: readonly Mode[] = ["lit", "color", "picture", "normal", "id", "depth"];

/** A rectangle of the screen and the tile that fills it. Device pixels, y down; the quads of a pass are disjoint. */
export interface Quad {
  readonly from: Tile;
  /** Left, top, right, bottom. */
  readonly rect: readonly [number, number, number, number];
  /** The tile's top left corner on the screen. */
  readonly origin: readonly [number, number];
  /** Texels per device pixel. */
  readonly scale: number;
}

/** Access to the tiles in memory. */
export interface TileAccess {
  /** Returns the unique key of a tile's data in the cache. */
  key(kind: LayerKind, tile: Tile): string;
  /** Returns a tile's data; null: empty, or only the drawer has it; undefined: not in memory. */
  data(kind: LayerKind, tile: Tile): TileData | null | undefined;
  /** Called when the drawer has its own copy, so that ours can be released. */
  onUploaded(kind: LayerKind, tile: Tile): void;
}

/** One image layer in a frame. */
export interface LayerPass {
  readonly mode: Mode;
  /** The level whose tile pixels are nearest in size to device pixels; quads are of this level or fall back for it. */
  readonly level: number;
  readonly quads: readonly Quad[];
  readonly tiles: TileAccess;
  /** Highlight colours by object id. */
  readonly highlight: ReadonlyMap<number, Rgb>;
  /** Styles of objects; null: all are plain. */
  readonly drawStyles: DrawStyles | null;
  /** Rendered light, applied where its tiles are in memory. */
  readonly bakedLight: BakedLight;
  /** Whether colour has no alpha, so that the id layer tells which pixels are covered. */
  readonly masked: boolean;
  readonly opacity: number;
  /** Combines the pass with others by depth; null: draws it over earlier passes. */
  readonly depths: DepthMapping | null;
  /** The mapping of its depths, combined or not; null: it has no depths. */
  readonly relief: DepthMapping | null;
  /** The part of the map in which it is visible; null: all of it. */
  readonly clip: Clip | null;
  /** Depth values of the first and the last false colour. */
  readonly depthRange: readonly [number, number];
}

/** The rendered light that matches the current light. */
export interface BakedLight {
  readonly shadow: Shadow | null;
  readonly occlusion: boolean;
}

/** Camera, size and light of a frame. */
export interface FrameState {
  readonly camera: Camera;
  /** Device pixels. */
  readonly width: number;
  readonly height: number;
  /** Device pixels per CSS pixel. */
  readonly dpr: number;
  readonly light: Readonly<Light>;
}

/** Content that is not made of tiles but combined with them by depth, like MapLibre's custom layers. WebGL only. */
export interface CustomLayer {
  /** Returns the minimum and maximum D of its content along a frame; null: it shows nothing. */
  getDepthRange(frame: Frame): Vec2 | null;
  /** Draws into its own buffers before the frame is drawn. Restores the context's default state, except for pixel storage parameters. @param range minimum and maximum D of the whole frame */
  prerender(gl: WebGL2RenderingContext, state: FrameState, range: Vec2): void;
  /** Draws the prepared content into the bound framebuffer, premultiplied, with depth as a fraction of the range. @param soft draws only partly covered pixels; false: only fully covered ones */
  render(gl: WebGL2RenderingContext, state: FrameState, soft: boolean): void;
}

/** Everything that a drawer draws in a frame. */
export interface FrameContent extends FrameState {
  readonly passes: readonly LayerPass[];
  readonly customLayers: readonly CustomLayer[];
  /** WebGL only: estimates light that was not rendered; while the camera moves, the last estimate is used. */
  readonly lighting?: { readonly estimator: LightEstimator; readonly moving: boolean } | null;
  /** WebGL only: draws into a framebuffer instead of the canvas, with the depth of all passes as a fraction of a range of D. */
  readonly target?: { readonly framebuffer: WebGLFramebuffer; readonly range: Vec2 };
}

export interface DrawerEvents {
  /** The context is lost: tiles that only the drawer had must be fetched again. */
  lost(): void;
  restored(): void;
  /** Something has become ready: a frame is needed. */
  changed(): void;
  failed(error: Error): void;
}

/** Draws frames. It never requests tiles, and requests frames only through `changed`. */
export interface Drawer {
  readonly name: "webgl" | "canvas";
  /** The element that shows the picture: a canvas, or an element that contains some. */
  readonly element: HTMLElement;
  /** Whether the last frame is incomplete; `changed` fires when more is ready. */
  readonly busy: boolean;
  /** Whether the picture is still that of the previous view, since nothing of the current one is ready. */
  readonly showsPreviousView: boolean;
  /** null when it does not use WebGL. */
  readonly gl: WebGL2RenderingContext | null;
  draw(frame: FrameContent): void;
  /** Called when a tile has left the cache. */
  release(key: string): void;
  destroy(): void;
}

/** Lists the layers that a tile needs in a mode. @param combined whether it is combined with others by depth */
export function listRequiredKinds(mode: Mode, masked: boolean, combined: boolean): LayerKind[] {
  const shown = listShownKinds(mode, masked);
  return combined && mode !== "depth" ? [...shown, "depth"] : shown;
}

function listShownKinds(mode: Mode, masked: boolean): LayerKind[] {
  if (mode === "lit") return masked ? ["color", "normal", "id"] : ["color", "normal"];
  if (mode === "color" || mode === "picture") return masked ? [mode, "id"] : [mode];
  return [mode];
}

/** Lists the layers that a mode uses if they are in memory. */
export function listBakedLightKinds(mode: Mode, { shadow, occlusion }: BakedLight): LayerKind[] {
  if (mode !== "lit") return [];
  return [...(shadow ? [shadow.layer.kind as LayerKind] : []), ...(occlusion ? ["ao" as const] : [])];
}
