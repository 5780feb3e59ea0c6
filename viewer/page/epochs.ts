import { imageLayer, type map } from "./map3d.mjs";
import { byId } from "./dom";

/** Base URLs of the other epochs, `?with=` (given again for more); a name without a slash is a rendering beside the first. */
export function othersOf(base: string): string[] {
  const asked = new URLSearchParams(location.search).getAll("with").filter((url) => url !== "");
  return asked.map((url) => (url.includes("/") ? url : `${base.replace(/\/+$/, "")}/../${url}`));
}

/** A slider from the first rendering to the others. What cannot be shown is left out; the map has said why. @param changed told what is shown when it is not the first any more */
export async function bindEpochs(view: map, first: imageLayer, others: readonly string[], asked: number, changed: (layer: imageLayer, index: number) => void): Promise<void> {
  const ready = await Promise.allSettled(others.map((url) => added(view, url)));
  const layers = [first, ...ready.flatMap((one) => (one.status === "fulfilled" ? [one.value] : []))];
  if (layers.length < 2) return;
  const { epochs } = await import("./map3d-compare.mjs");
  const shown = asked < layers.length ? asked : 0;
  byId("epochs").hidden = false;
  new epochs(layers.map((layer) => ({ layer, label: labelOf(layer, layers) })), { shown, container: byId("epochs") })
    .on("change", ({ epoch, index }) => { changed(epoch.layer, index); })
    .addTo(view);
  byId("modes").addEventListener("change", () => { for (const layer of layers) layer.setMode(first.mode); });
  if (shown > 0) changed(layers[shown] ?? first, shown);
}

function added(view: map, url: string): Promise<imageLayer> {
  return new Promise((done, failed) => {
    const layer = new imageLayer(url, { opacity: 0 });
    layer.once("ready", () => { done(layer); });
    layer.once("error", ({ error }) => {
      view.discard(layer);
      failed(error);
    });
    layer.addTo(view);
  });
}

/** Its title, unless another one has the same. */
function labelOf(layer: imageLayer, layers: readonly imageLayer[]): string {
  const { title = "", name = "" } = layer.rendering?.json ?? {};
  return title !== "" && layers.every((other) => other === layer || other.rendering?.json.title !== title) ? title : name;
}
