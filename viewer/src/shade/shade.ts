import { MapLayer, type ImageLayer, type Light, type Map3D } from "../map3d";
import { DepthLightEstimator } from "./depthLightEstimator";
import { ScreenSpaceLight } from "./screenSpaceLight";

/** Options of `shade`. */
export interface ShadeOptions {
  /** Radius of ambient occlusion, metres. Default 20. */
  radius_m?: number;
  /** Assumed thickness of objects behind their visible surface, metres. Default 6. */
  thickness_m?: number;
}

/**
 * Computes screen-space shadows and ambient occlusion from depth, for layers that have no rendered shadows and occlusion for the current light. Objects
 * outside the screen or behind others cast no shadow. Needs WebGL; the canvas drawer shows the light without shadows. Reads depth tiles.
 */
export class Shade extends MapLayer<Map3D, object> {
  readonly #light: ScreenSpaceLight;
  readonly #free = (): void => this.#light.free();

  constructor({ radius_m = 20, thickness_m = 6 }: ShadeOptions = {}) {
    super();
    this.#light = new ScreenSpaceLight(new DepthLightEstimator(radius_m, thickness_m), () => new Shade({ radius_m, thickness_m }));
  }

  /** Depth, unless all layers have rendered shadows and occlusion, or the map does not draw with WebGL. */
  get needs(): readonly "depth"[] {
    const { map } = this;
    return map?.drawer === "webgl" && map.layers.some((layer) => lacksBakedLight(layer, map.light)) ? ["depth"] : [];
  }

  protected onAdd(map: Map3D): void {
    map.setLightEstimator(this.#light).on("contextlost", this.#free);
  }

  protected onRemove(map: Map3D): void {
    map.setLightEstimator(null).off("contextlost", this.#free);
    this.#free();
  }
}

/** Does the layer lack shadows or occlusion for this light? */
function lacksBakedLight(layer: ImageLayer, light: Readonly<Light>): boolean {
  const baked = layer.getBakedLight(light);
  return (
    baked !== null &&
    layer.mode === "lit" &&
    light.lit &&
    ((light.occlusion && !baked.occlusion) || (light.shadows && light.elevation_deg > 0 && !baked.shadow))
  );
}
