import { FetchError, ImageLayer, Map3D, Map3dError } from "./map3d.module.js";
import type { Overview } from "./map3d-controls.module.js";
import { Permalink, readPermalink } from "./permalink";
import { Colors } from "./colors";
import { Compare } from "./compare";
import { bindEpochs, otherEpochs } from "./epochs";
import { InfoPanel } from "./info";
import { bindLight, FIRST_HOUR, lightAt, showShadowSwitch } from "./light";
import { Tools } from "./tools";
import { bindLoading } from "./loading";
import { Haze } from "./haze";
import { bindModes } from "./modes";
import { bindSearch } from "./search";
import { bindOffline } from "./offline";
import { bindPicture } from "./picture";
import { bindInViewList } from "./inViewList";
import { Selection } from "./selection";
import { bindShare } from "./share";
import { bindOpening } from "./opening";
import { showThumbnail } from "../src/element/thumbnail";
import { bindNetwork, report, showFailure } from "./toast";
import { byId } from "./dom";
import { requestedUrls } from "./requested";
import { message, translatePage } from "./i18n";

/** Base URLs of the rendering: `?rendering=` (repeat it for further hosts of the same tiles), `data-base` on `<html>`, or this folder. */
function baseUrls(): string[] {
  const requested = requestedUrls("rendering");
  return requested.length > 0 ? requested : [document.documentElement.dataset["base"] ?? "."];
}

/** Characters. A longer title is cut. */
const MAX_TITLE = 200;

function open(): void {
  const isFresh = location.hash === "";
  const { time, id, by, epoch = 0, ...start } = readPermalink(location.hash);
  const view = new Map3D("mapcanvas", { cover: true, gestureHandling: "auto", light: lightAt(FIRST_HOUR), ...start });
  const urls = baseUrls();
  const layer = new ImageLayer(urls);
  const info = new InfoPanel(byId("info"), () => selection.clear());
  const permalink = new Permalink(view);
  const selection = new Selection(view, layer, info, permalink);
  view.on("error", ({ error }) => showError(layer, error));
  let tools: Tools | undefined;
  view.on("click", (event) => {
    if (!tools?.active) selection.select(event);
  });
  layer.on("ready", () => {
    bindPage(view, layer, info, selection, time);
    bindShare(permalink);
    permalink.by = by ?? "";
    const colors = new Colors(view, layer, permalink);
    let haze: Haze | undefined;
    if (layer.rendering)
      bindPicture({ view, json: layer.rendering.json, legend: () => colors.theme, overlay: (paper) => haze?.capture(paper) });
    if (layer.rendering) bindOffline(view, layer.rendering.json.name);
    colors.open().catch(report);
    loadEntries(view, layer, isFresh).catch(report);
    const others = otherEpochs(urls[0] ?? ".");
    bindEpochs(view, layer, others, epoch, (shown, index) => {
      permalink.epoch = index;
      selection.setLayer(shown);
      colors.setLayer(shown).catch(report);
      permalink.write();
    }).then(() => {
      if (id !== undefined) void selection.selectId(id, null, false);
    }, report);
    if (layer.rendering?.layers.has("depth")) tools = new Tools(view);
    // Epochs can end elsewhere.
    if (others.length === 0) haze = new Haze(view, layer);
    const compare = new Compare({
      view,
      hasHaze: others.length === 0,
      onClick: (event) => selection.select(event),
    });
    selection.onChange = () => compare.highlight();
  });
  showThumbnail(view, layer);
  layer.addTo(view);
  bindLoading(view);
}

/** Adds what the page does not need for its first picture. @param opens whether the map begins with a turn around the content */
async function loadEntries(view: Map3D, layer: ImageLayer, opens: boolean): Promise<void> {
  // Depth is as large as colours and normals: it loads after the first picture.
  if (layer.rendering?.layers.has("depth") && !view.options.dataSaver)
    view.once("load", () => {
      import("./map3d-shade.module.js").then(({ Shade }) => {
        new Shade().addTo(view);
        if (view.drawer === "webgl") showShadowSwitch();
      }, report);
      import("./map3d-orbit.module.js")
        .then(({ Orbit }) => {
          const turn = new Orbit().addTo(view);
          if (opens) bindOpening(view, turn);
        })
        .catch(report);
    });
  const { Locate, Overview } = await import("./map3d-controls.module.js");
  if (layer.rendering?.json.geographic) new Locate().addTo(view);
  bindOverview(view, new Overview({ collapsed: true }).addTo(view));
}

/** Reports an error; without a map, or without a way to its tiles, in place of the page. */
function showError(layer: ImageLayer, error: Error): void {
  // Archives are requested in parts.
  const ignoresRanges = layer.rendering && error instanceof FetchError && error.status === 200;
  if (layer.rendering && !ignoresRanges) {
    report(error);
    return;
  }
  showFailure(message("mapFailed"), ignoresRanges ? message("noRanges") : error.message);
  if (!navigator.onLine) addEventListener("online", () => location.reload());
}

/** Zoom levels above the lowest at which the overview opens, on wide screens: about one quarter of the scene is in view. */
const OVERVIEW_ZOOM = 2.4;
const WIDE = "(min-width: 640px)";

/** Opens the overview once, when a small part of the scene is in view. */
function bindOverview(view: Map3D, small: Overview): void {
  const open = (): void => {
    if (view.zoom < view.zoomLimits[0] + OVERVIEW_ZOOM || !matchMedia(WIDE).matches) return;
    view.off("zoom", open);
    small.toggle(true);
  };
  view.on("zoom", open);
  open();
}

/** Fills in and binds the page's controls, once the map is ready. */
function bindPage(view: Map3D, layer: ImageLayer, info: InfoPanel, selection: Selection, time: Date | undefined): void {
  const json = layer.rendering?.json;
  if (!json) return;
  document.title = byId("title").textContent = (json.title || json.name).slice(0, MAX_TITLE);
  view.container.setAttribute("role", "group");
  view.container.setAttribute("aria-label", document.title);
  byId("incomplete").hidden = json.complete;
  byId("data-saver").hidden = !view.options.dataSaver;
  byId("settings").hidden = byId("tools").hidden = false;
  byId("more").addEventListener("click", ({ currentTarget }) => {
    const more = currentTarget as HTMLElement;
    more.setAttribute("aria-expanded", String(more.getAttribute("aria-expanded") !== "true"));
  });
  info.lonLat = (position) => view.lonLat(position);
  info.units = { crs: json.crs.name, vertical: json.crs.vertical };
  bindLight(view, layer, time);
  bindModes(layer);
  if (json.objects) {
    bindInViewList(
      view,
      () => selection.layer,
      (id) => void selection.selectId(id),
    );
    bindSearch(
      view,
      () => selection.layer,
      (id, position, zoom) => void selection.goTo(id, position, zoom),
    );
  }
}

try {
  translatePage();
  bindNetwork();
  open();
} catch (reason) {
  showFailure(message("pageFailed"), reason instanceof Map3dError ? reason.message : String(reason));
}
