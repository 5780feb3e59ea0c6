import type { Light } from "../../geo/light";
import { towardsLight } from "../../geo/light";
import type { LayerKind } from "../../geo/manifest";
import type { Vec2, Vec3 } from "../../core/vec";
import { neededKinds, type FrameSpec, type Mode, type Pass } from "../drawer";

/** All that a tile's picture depends on besides the tile. */
export interface Look {
  readonly mode: Mode;
  readonly masked: boolean;
  /** Of lit tiles: unit vector towards the sun, ambient, diffuse. */
  readonly light: { readonly sun: Vec3; readonly ambient: number; readonly diffuse: number } | null;
  /** Under this name the worker has the colours of highlighted ids. */
  readonly highlight: string | null;
  /** A highlight's rim: pixels to the right and below, to the left and above (negative), at which the id differs. */
  readonly rim: Vec2;
  readonly depthRange: Vec2 | null;
}

/** Kinds that a picture is made from. Without ids a highlight is not shown. */
export function kindsOf(look: Look): LayerKind[] {
  const needed = neededKinds(look.mode, look.masked);
  return look.highlight !== null && !needed.includes("id") ? [...needed, "id"] : needed;
}

/** Kinds of which the pixels beyond the tile's edge count, too. */
export function kindsBeside(look: Look): LayerKind[] {
  return [...(look.light ? ["normal" as const] : []), ...(look.highlight === null ? [] : ["id" as const])];
}

/** @param scale texels a device pixel  @param highlight name of the pass's highlighted ids */
export function lookOf({ light, dpr }: FrameSpec, pass: Pass, scale: number, highlight: string | null): Look {
  const mode = pass.mode === "lit" && !light.lit ? "color" : pass.mode;
  return {
    mode,
    masked: pass.masked && (mode === "lit" || mode === "color"),
    light: mode === "lit" ? lampOf(light) : null,
    highlight,
    rim: highlight === null ? [0, 0] : rimOf(Math.max(1, 1.25 * dpr * scale)),
    depthRange: mode === "depth" ? pass.depthRange : null,
  };
}

const lampOf = (light: Readonly<Light>): Look["light"] => ({ sun: towardsLight(light), ambient: light.ambient, diffuse: light.diffuse });

/** From a pixel's middle. */
const rimOf = (width: number): Vec2 => [Math.floor(0.5 + width), Math.floor(0.5 - width)];
