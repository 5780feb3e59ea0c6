import { MapLayer, type imageLayer, type Light, type map } from "../map3d";
import { Shading } from "./shading";

/** How light is found from depth. */
export interface ShadeOptions {
  /** What stands nearer keeps the sky's light off: metres. 20 when left out. */
  radius_m?: number;
  /** What is seen counts as solid so far behind its surface: metres. 6 when left out. */
  thickness_m?: number;
}

/**
 * Shadows and ambient occlusion found from the depth that is seen, for layers without rendered ones that suit the light.
 * As good as what is seen: things outside the screen or behind others cast no shadow. WebGL only; the canvas drawer shows
 * the light without them. Reads depth: its tiles are fetched.
 */
export class shade extends MapLayer<map, object> {
  readonly #shading: Shading;

  constructor({ radius_m = 20, thickness_m = 6 }: ShadeOptions = {}) {
    super();
    this.#shading = new Shading(radius_m, thickness_m);
  }

  /** Depth, unless all light is rendered or nothing is drawn with it. */
  get needs(): readonly "depth"[] {
    const { map } = this;
    return map?.drawer === "webgl" && map.layers.some((layer) => lacks(layer, map.light)) ? ["depth"] : [];
  }

  protected onAdd(map: map): void {
    map.setLightEstimator(this.#shading);
  }

  protected onRemove(map: map): void {
    map.setLightEstimator(null);
    this.#shading.free();
  }
}

/** Is there light that could be found? */
function lacks(layer: imageLayer, light: Readonly<Light>): boolean {
  const baked = layer.getBakedLight(light);
  return baked !== null && layer.mode === "lit" && light.lit && ((light.occlusion && !baked.occlusion) || (light.shadows && light.altitude_deg > 0 && !baked.shadow));
}
