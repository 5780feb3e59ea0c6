import { imageLayer, map, Map3dError, type ClickEvent, type Vec3 } from "./map3d.mjs";
import { InfoPanel } from "./info";
import { bindLight, lightAt } from "./light";
import { Tools } from "./tools";
import { bindModes } from "./modes";
import { bindSearch } from "./search";
import { readPlace, writePlace } from "./place";
import { fail, toast } from "./messages";
import { byId } from "./dom";

const QUIET = new Set(["terrain", "ground"]);

/** Base URLs of the rendering: `?rendering=` (again for further hosts), `data-base` on <html>, else this folder. */
function bases(): string[] {
  const asked = new URLSearchParams(location.search).getAll("rendering").filter((url) => url !== "");
  return asked.length > 0 ? asked : [document.documentElement.dataset["base"] ?? "."];
}

function open(): void {
  const place = readPlace(location.hash);
  const view = new map("mapcanvas", { light: lightAt(14), ...place });
  const layer = new imageLayer(bases());
  const info = new InfoPanel(byId("info"), () => layer.clearHighlight());
  view.on("error", ({ error }) => {
    if (layer.rendering) toast(error.message);
    else fail("This rendering cannot be shown", error.message);
  });
  let tools: Tools | undefined;
  view.on("click", (event) => {
    if (!tools?.active) show(event, layer, info);
  });
  view.on("moveend", () => {
    writePlace(view);
  });
  view.on("directionchange", () => {
    writePlace(view);
  });
  layer.on("ready", () => {
    dress(view, layer, info);
    if (layer.rendering?.layers.has("depth")) tools = new Tools(view);
  });
  layer.addTo(view);
}

/** The page around a map that is ready. */
function dress(view: map, layer: imageLayer, info: InfoPanel): void {
  const json = layer.rendering?.json;
  if (!json) return;
  document.title = json.title || json.name;
  byId("title").textContent = json.title || json.name;
  byId("progress").hidden = json.complete;
  byId("look").hidden = false;
  info.units = { crs: json.crs.name, vertical: json.crs.vertical };
  bindLight(view, layer);
  bindModes(layer);
  if (json.objects) {
    bindSearch(view, layer, (id, position) => void describe(id, position, layer, info));
  }
}

/** An object that was searched for: as if it had been clicked. */
async function describe(id: number, position: Vec3, layer: imageLayer, info: InfoPanel): Promise<void> {
  const object = await layer.object(id).catch((reason: unknown) => {
    toast(String(reason));
    return null;
  });
  show({ id, position, approximate: false, layer, point: [0, 0], ...(object ?? {}) }, layer, info);
}

function show(event: ClickEvent, layer: imageLayer, info: InfoPanel): void {
  layer.clearHighlight();
  if (event.id === 0 && !event.position) {
    info.close();
    return;
  }
  if (event.id > 0 && !QUIET.has(event.class ?? "")) layer.highlight(event.id);
  info.show(event);
}

try {
  open();
} catch (reason) {
  fail("This page cannot start", reason instanceof Map3dError ? reason.message : String(reason));
}
