import { ImageLayer, type Map3D } from "./map3d.module.js";
import { byId } from "./dom";
import { requestedUrls } from "./requested";

/** Base URLs of the other epochs: `?with=`, which can be repeated. A name without a slash is a sibling folder of the first rendering. */
export function otherEpochs(base: string): string[] {
  return requestedUrls("with").map((url) => (url.includes("/") ? url : `${base.replace(/\/+$/, "")}/../${url}`));
}

/** Adds a slider over all epochs. Skips renderings that cannot be loaded; the map reports why. @param initial index of the epoch to show first  @param onChange called with the newly shown layer */
export async function bindEpochs(
  view: Map3D,
  first: ImageLayer,
  others: readonly string[],
  initial: number,
  onChange: (layer: ImageLayer, index: number) => void,
): Promise<void> {
  const results = await Promise.allSettled(others.map((url) => addLayer(view, url)));
  const layers = [first, ...results.flatMap((result) => (result.status === "fulfilled" ? [result.value] : []))];
  if (layers.length < 2) return;
  const { Epochs } = await import("./map3d-compare.module.js");
  const shown = initial < layers.length ? initial : 0;
  byId("epochs").hidden = false;
  new Epochs(
    layers.map((layer) => ({ layer, label: labelOf(layer, layers) })),
    { shown, container: byId("epochs") },
  )
    .on("change", ({ epoch, index }) => onChange(epoch.layer, index))
    .addTo(view);
  byId("modes").addEventListener("change", () => {
    for (const layer of layers) layer.setMode(first.mode);
  });
  if (shown > 0) onChange(layers[shown] ?? first, shown);
}

function addLayer(view: Map3D, url: string): Promise<ImageLayer> {
  return new Promise((resolve, reject) => {
    const layer = new ImageLayer(url, { opacity: 0 });
    layer.once("ready", () => resolve(layer));
    layer.once("error", ({ error }) => {
      view.discard(layer);
      reject(error);
    });
    layer.addTo(view);
  });
}

/** The title if it is unique, else the name. */
function labelOf(layer: ImageLayer, layers: readonly ImageLayer[]): string {
  const { title = "", name = "" } = layer.rendering?.json ?? {};
  return title !== "" && layers.every((other) => other === layer || other.rendering?.json.title !== title) ? title : name;
}
