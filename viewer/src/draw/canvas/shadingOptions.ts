import type { Light } from "../../geo/light";
import { towardsLight } from "../../geo/light";
import type { LayerKind } from "../../geo/manifest";
import type { Vec2, Vec3 } from "../../core/vec";
import type { Shadow } from "../../geo/shadows";
import type { Mask } from "./mask";
import { listRequiredKinds, type BakedLight, type FrameContent, type Mode, type Pass } from "../drawer";

/** Of lit tiles. */
interface TileLight {
  /** Unit vector towards the sun. */
  readonly sun: Vec3;
  /** Linear light, RGB: everywhere, and of the sun on a surface that faces it. */
  readonly sky: Vec3;
  readonly beam: Vec3;
  readonly occlusion: boolean;
  readonly shadow: (Omit<Shadow, "layer"> & { readonly kind: "sun" | "sun16" }) | null;
}

/** All that a tile's picture depends on besides the tile. */
export interface ShadingOptions {
  readonly mode: Mode;
  readonly masked: boolean;
  readonly light: TileLight | null;
  /** Under this name the worker has the colours of highlighted ids. */
  readonly highlight: string | null;
  /** Under this name it has the finishes of objects. */
  readonly styles: string | null;
  /** A highlight's rim: pixels to the right and below, to the left and above (negative), at which the id differs. */
  readonly rim: Vec2;
  readonly depthRange: Vec2 | null;
  /** Other layers may hide it. */
  readonly combined: boolean;
  /** Tiles of theirs that lie over it. */
  readonly masks: readonly Mask[];
}

/** Kinds that a picture is made from. Without ids neither highlights nor finishes are shown. */
export function listKinds(look: ShadingOptions): LayerKind[] {
  const needed = listRequiredKinds(look.mode, look.masked, look.combined);
  return [...needed, ...listBakedKinds(look), ...((look.highlight !== null || look.styles !== null) && !needed.includes("id") ? ["id" as const] : [])];
}

/** Rendered light; what is not here is done without. */
function listBakedKinds({ light }: ShadingOptions): LayerKind[] {
  return [...(light?.shadow ? [light.shadow.kind] : []), ...(light?.occlusion ? ["ao" as const] : [])];
}

/** The look of a picture for which some layers are not here. */
export function restrictOptions(look: ShadingOptions, has: (kind: LayerKind) => boolean): ShadingOptions {
  const { light, highlight, styles } = look;
  const lamp = light && { ...light, occlusion: light.occlusion && has("ao"), shadow: light.shadow && has(light.shadow.kind) ? light.shadow : null };
  return { ...look, light: lamp, highlight: has("id") ? highlight : null, styles: has("id") ? styles : null };
}

/** Kinds of which the pixels beyond the tile's edge count, too. */
export function listNeighbourKinds(look: ShadingOptions): LayerKind[] {
  return [...(look.light ? ["normal" as const, ...listBakedKinds(look)] : []), ...(look.highlight === null ? [] : ["id" as const])];
}

/** Names of the pass's highlighted ids and of its finishes. */
export interface IdTableNames {
  readonly highlight: string | null;
  readonly styles: string | null;
}

/** @param scale texels a device pixel */
export function makeShadingOptions({ light, dpr }: Pick<FrameContent, "light" | "dpr">, pass: Pass, scale: number, { highlight, styles }: IdTableNames): ShadingOptions {
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
    shadow: shadow && { kind: shadow.layer.kind === "sun" ? "sun" : "sun16", first: shadow.first, second: shadow.second, share: shadow.share },
  };
}

/** From a pixel's middle. */
const computeRim = (width: number): Vec2 => [Math.floor(0.5 + width), Math.floor(0.5 - width)];
