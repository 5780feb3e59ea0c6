import type { Light } from "../../geo/light";
import { towardsLight } from "../../geo/light";
import type { LayerKind } from "../../tiles/tileData";
import type { Vec2, Vec3 } from "../../core/vec";
import type { Shadow } from "../../geo/shadows";
import type { Mask } from "./mask";
import { listRequiredKinds, type BakedLight, type FrameContent, type Mode, type LayerPass } from "../drawer";

/** The light on a tile. */
export interface TileLight {
  /** Unit vector towards the sun. */
  readonly sun: Vec3;
  /** Linear light, RGB: ambient, and of the sun on a surface that faces it. */
  readonly sky: Vec3;
  readonly beam: Vec3;
  readonly occlusion: boolean;
  readonly shadow: (Omit<Shadow, "layer"> & { readonly kind: "sun" | "sun16" }) | null;
}

/** Everything that determines a tile's picture, apart from its data. */
export interface ShadingOptions {
  readonly mode: Mode;
  readonly masked: boolean;
  readonly light: TileLight | null;
  /** Name of the highlight colours in the worker. */
  readonly highlight: string | null;
  /** Name of the styles in the worker. */
  readonly styles: string | null;
  /** Offsets at which another id makes a highlight's rim: to the right and below, to the left and above (negative). */
  readonly rim: Vec2;
  readonly depthRange: Vec2 | null;
  /** Whether other layers may hide it. */
  readonly combined: boolean;
  /** Tiles of other layers that overlap it. */
  readonly masks: readonly Mask[];
}

/** Lists the layers that a picture uses. Without ids neither highlights nor styles are shown. */
export function listKinds(options: ShadingOptions): LayerKind[] {
  const needed = listRequiredKinds(options.mode, options.masked, options.combined);
  return [
    ...needed,
    ...listBakedKinds(options),
    ...((options.highlight !== null || options.styles !== null) && !needed.includes("id") ? ["id" as const] : []),
  ];
}

/** Lists the layers of baked light; missing ones are skipped. */
function listBakedKinds({ light }: ShadingOptions): LayerKind[] {
  return [...(light?.shadow ? [light.shadow.kind] : []), ...(light?.occlusion ? ["ao" as const] : [])];
}

/** Restricts the options to the layers that are loaded. */
export function restrictOptions(options: ShadingOptions, has: (kind: LayerKind) => boolean): ShadingOptions {
  const { light, highlight, styles } = options;
  const tileLight = light && {
    ...light,
    occlusion: light.occlusion && has("ao"),
    shadow: light.shadow && has(light.shadow.kind) ? light.shadow : null,
  };
  return { ...options, light: tileLight, highlight: has("id") ? highlight : null, styles: has("id") ? styles : null };
}

/** Lists the layers whose pixels beyond the tile's edges matter. */
export function listNeighbourKinds(options: ShadingOptions): LayerKind[] {
  return [
    ...(options.light ? ["normal" as const, ...listBakedKinds(options)] : []),
    ...(options.highlight === null ? [] : ["id" as const]),
  ];
}

/** Names of a pass's highlight colours and styles in the worker. */
export interface IdTableNames {
  readonly highlight: string | null;
  readonly styles: string | null;
}

/** Makes the options for a tile of a pass. @param scale texels per device pixel */
export function makeShadingOptions(
  { light, dpr }: Pick<FrameContent, "light" | "dpr">,
  pass: LayerPass,
  scale: number,
  { highlight, styles }: IdTableNames,
): ShadingOptions {
  const mode = pass.mode === "lit" && !light.lit ? "color" : pass.mode;
  const colored = mode === "lit" || mode === "color" || mode === "picture";
  return {
    mode,
    masked: pass.masked && colored,
    light: mode === "lit" ? makeTileLight(light, pass.bakedLight) : null,
    highlight,
    styles: colored ? styles : null,
    rim: highlight === null ? [0, 0] : computeRim(Math.max(1, 1.25 * dpr * scale)),
    depthRange: mode === "depth" ? pass.depthRange : null,
    combined: pass.depths !== null,
    masks: [],
  };
}

function makeTileLight(light: Readonly<Light>, { shadow, occlusion }: BakedLight): TileLight {
  const scaled = (rgb: Vec3, by: number): Vec3 => [rgb[0] * by, rgb[1] * by, rgb[2] * by];
  return {
    sun: towardsLight(light),
    sky: scaled(light.sky_rgb, light.ambient),
    beam: scaled(light.sun_rgb, light.diffuse),
    occlusion,
    shadow: shadow && {
      kind: shadow.layer.kind === "sun" ? "sun" : "sun16",
      first: shadow.first,
      second: shadow.second,
      share: shadow.share,
    },
  };
}

/** Computes the offsets from a pixel's centre. */
const computeRim = (width: number): Vec2 => [Math.floor(0.5 + width), Math.floor(0.5 - width)];
