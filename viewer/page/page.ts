import { imageLayer, map, Map3dError } from "./map3d.mjs";
import { Address } from "./address";
import { Colors } from "./colors";
import { bindEpochs, othersOf } from "./epochs";
import { InfoPanel } from "./info";
import { bindLight, lightAt } from "./light";
import { Tools } from "./tools";
import { bindModes } from "./modes";
import { bindSearch } from "./search";
import { bindOffline } from "./offline";
import { bindPicture } from "./picture";
import { readPlace } from "./place";
import { bindSeen } from "./seen";
import { Selection } from "./selection";
import { bindShare } from "./share";
import { fail, toast } from "./messages";
import { byId } from "./dom";
import { say, translate } from "./i18n";

/** Base URLs of the rendering: `?rendering=` (again for further hosts), `data-base` on <html>, else this folder. */
function bases(): string[] {
  const asked = new URLSearchParams(location.search).getAll("rendering").filter((url) => url !== "");
  return asked.length > 0 ? asked : [document.documentElement.dataset["base"] ?? "."];
}

function open(): void {
  const { time, id, by, epoch = 0, ...place } = readPlace(location.hash);
  const view = new map("mapcanvas", { light: lightAt(14), ...place });
  const urls = bases();
  const layer = new imageLayer(urls);
  const info = new InfoPanel(byId("info"), () => { selection.forget(); });
  const address = new Address(view);
  const selection = new Selection(view, layer, info, address);
  view.on("error", ({ error }) => {
    if (layer.rendering) toast(navigator.onLine ? error.message : say("offlineOnly"));
    else fail(say("notShown"), error.message);
  });
  let tools: Tools | undefined;
  view.on("click", (event) => {
    if (!tools?.active) selection.choose(event);
  });
  layer.on("ready", () => {
    dress(view, layer, info, selection, time);
    bindShare(address);
    address.by = by ?? "";
    const colors = new Colors(view, layer, address);
    if (layer.rendering) bindPicture({ view, json: layer.rendering.json, legend: () => colors.theme });
    if (layer.rendering) bindOffline(view, layer.rendering.json.name);
    colors.open().catch((reason: unknown) => { toast(String(reason)); });
    import("./map3d-controls.mjs").then(({ locate, overview }) => {
      if (layer.rendering?.json.geographic) new locate().addTo(view);
      new overview().addTo(view);
    }, (reason: unknown) => { toast(String(reason)); });
    if (layer.rendering?.layers.has("depth") && !view.options.dataSaver) {
      import("./map3d-shade.mjs").then(({ shade }) => new shade().addTo(view), (reason: unknown) => { toast(String(reason)); });
      import("./map3d-orbit.mjs").then(({ orbit }) => new orbit().addTo(view), (reason: unknown) => { toast(String(reason)); });
    }
    bindEpochs(view, layer, othersOf(urls[0] ?? "."), epoch, (shown, index) => {
      address.epoch = index;
      selection.use(shown);
      colors.use(shown).catch((reason: unknown) => { toast(String(reason)); });
      address.write();
    }).then(() => {
      if (id !== undefined) void selection.chooseId(id, null, false);
    }, (reason: unknown) => { toast(String(reason)); });
    if (layer.rendering?.layers.has("depth")) tools = new Tools(view);
  });
  layer.addTo(view);
}

/** The page around a map that is ready. */
function dress(view: map, layer: imageLayer, info: InfoPanel, selection: Selection, time: Date | undefined): void {
  const json = layer.rendering?.json;
  if (!json) return;
  document.title = json.title || json.name;
  byId("title").textContent = json.title || json.name;
  byId("progress").hidden = json.complete;
  byId("saving").hidden = !view.options.dataSaver;
  byId("look").hidden = byId("tools").hidden = false;
  byId("more").addEventListener("click", ({ currentTarget }) => {
    const more = currentTarget as HTMLElement;
    more.setAttribute("aria-expanded", String(more.getAttribute("aria-expanded") !== "true"));
  });
  info.units = { crs: json.crs.name, vertical: json.crs.vertical };
  bindLight(view, layer, time);
  bindModes(layer);
  if (json.objects) {
    bindSeen(view, () => selection.layer, (id) => void selection.chooseId(id));
    bindSearch(view, () => selection.layer, (id, position) => void selection.chooseId(id, position));
  }
}

try {
  translate();
  open();
} catch (reason) {
  fail(say("notStarted"), reason instanceof Map3dError ? reason.message : String(reason));
}
