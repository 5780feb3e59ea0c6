import { add } from "../core/vec";
import type { ImageLayer, Map3D, ObjectInfo } from "../map3d";
import { properName, type Label } from "./label";

/** Objects that cover less of the screen are not read. */
const LEAST_SHARE = 0.0008;
/** Most objects that are read for one view. */
const MOST = 80;
const GROUND = ["terrain", "relief"];

/** Names the objects of a layer that are in view. */
export class ObjectLabels {
  readonly #layer: ImageLayer;
  readonly #name: (object: ObjectInfo, id: number) => string;
  /** Labels by the id of the outermost object; null: it has no name. */
  readonly #known = new Map<number, Label | null>();
  /** Outermost objects of parts. */
  readonly #roots = new Map<number, number>();

  constructor(layer: ImageLayer, name: (object: ObjectInfo, id: number) => string) {
    [this.#layer, this.#name] = [layer, name];
  }

  /** Reads the names of the largest objects in view; returns all names read so far. */
  async read(map: Map3D): Promise<readonly Label[]> {
    const seen = (await map.objectsInView()).filter(({ layer, share }) => layer === this.#layer && share >= LEAST_SHARE).slice(0, MOST);
    for (const { id } of seen) if (!this.#roots.has(id)) await this.#readObject(id);
    return [...this.#known.values()].filter((label) => label !== null);
  }

  async #readObject(id: number): Promise<void> {
    let [root, object] = [id, await this.#layer.object(id)];
    while (object?.parent != null) [root, object] = [object.parent, await this.#layer.object(object.parent)];
    this.#roots.set(id, root);
    const { rendering } = this.#layer;
    if (this.#known.has(root) || !rendering) return;
    const text = object && !GROUND.some((word) => object.class.toLowerCase().includes(word)) ? this.#name(object, root) : "";
    const box = object?.box;
    if (text === "" || !box) this.#known.set(root, null);
    else {
      const [low, high] = box;
      const size = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
      this.#known.set(root, {
        text,
        positions: [add(rendering.json.origin, [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2]])],
        rank: size,
        line: false,
      });
    }
  }
}

/** Its name attribute, else its name unless that is an identifier. */
export const nameOfObject = ({ name, attributes }: ObjectInfo): string => properName(attributes["name"]) || properName(name);
