import type { Map3D, ManifestJson } from "./map3d.module.js";
import type { PictureLegend, PictureOptions } from "./map3d-print.module.js";
import { byId, withText } from "./dom";
import { language, introduce, message } from "./i18n";

type PaperSize = readonly [long: number, short: number];

/** Paper sizes at 300 dpi, pixels. */
const PAPERS: readonly (readonly [name: string, size: PaperSize])[] = [
  ["A4", [3508, 2480]],
  ["A3", [4961, 3508]],
];
const SCALES = [1, 2, 4];
const PAPER_SCALE = 300 / 96;
const LONGEST_SIDE_PX = 8192;

/** The map to save or print. */
export interface PictureContext {
  readonly view: Map3D;
  readonly json: ManifestJson;
  /** The active theme's legend, if any. */
  legend(): PictureLegend | undefined;
  /** Draws what the page shows over the map. @param paper colour of the background, if it is not that of the map */
  readonly overlay: (paper?: readonly number[]) => PictureOptions["overlay"];
}

interface PictureSize {
  readonly name: string;
  readonly width_px: number;
  readonly height_px: number;
  readonly textScale: number;
}

/** Binds the dialog that saves the current view as a PNG file or prints it. */
export function bindPicture(context: PictureContext): void {
  const [button, dialog, select] = [byId("make-picture"), byId("picture") as HTMLDialogElement, byId("picture-size") as HTMLSelectElement];
  let sizes: readonly PictureSize[] = [];
  let running: AbortController | undefined;
  const note = (): void => {
    const size = sizes[select.selectedIndex];
    byId("picture-note").textContent = size ? `${String(size.width_px)} × ${String(size.height_px)} px` : "";
  };
  const run = (task: (size: PictureSize, signal: AbortSignal) => Promise<void>): void => {
    const size = sizes[select.selectedIndex];
    if (!size) return;
    running = new AbortController();
    const { signal } = running;
    showError("");
    setBusy(true);
    task(size, signal)
      .then(
        () => dialog.close(),
        (reason: unknown) => {
          if (!signal.aborted) showError(introduce("imageFailed", reason));
        },
      )
      .finally(() => setBusy(false));
  };
  button.addEventListener("click", () => {
    const at = Math.max(select.selectedIndex, 0);
    sizes = sizesOf(context.view.canvas);
    select.replaceChildren(...sizes.map(({ name }) => new Option(name)));
    select.selectedIndex = Math.min(at, sizes.length - 1);
    note();
    showError("");
    dialog.showModal();
  });
  select.addEventListener("change", note);
  dialog.addEventListener("close", () => running?.abort());
  byId("picture-save").addEventListener("click", () => run((size, signal) => save(context, size, signal)));
  byId("picture-print").addEventListener("click", () => run((size, signal) => print(context, size, signal)));
}

function sizesOf({ clientWidth: width, clientHeight: height }: HTMLCanvasElement): PictureSize[] {
  const screens = SCALES.map((scale) => ({
    name: `${message("screen")} × ${String(scale)}`,
    width_px: width * scale,
    height_px: height * scale,
    textScale: scale,
  }));
  const papers = PAPERS.map(([name, [long, short]]) => ({
    name: `${name}, 300 dpi`,
    width_px: width < height ? short : long,
    height_px: width < height ? long : short,
    textScale: PAPER_SCALE,
  }));
  return [...screens.filter(({ width_px, height_px }) => Math.max(width_px, height_px) <= LONGEST_SIDE_PX), ...papers];
}

function showError(text: string): void {
  byId("picture-failed").textContent = text;
  byId("picture-failed").hidden = text === "";
}

function setBusy(busy: boolean): void {
  byId("picture-busy").hidden = !busy;
  for (const id of ["picture-save", "picture-print", "picture-size"]) (byId(id) as HTMLButtonElement | HTMLSelectElement).disabled = busy;
  showProgress(0);
}

function showProgress(fraction: number): void {
  (byId("picture-progress") as HTMLProgressElement).value = fraction;
  byId("picture-percent").textContent = fraction.toLocaleString(language, { style: "percent" });
}

async function createPicture(
  { view, overlay }: PictureContext,
  { width_px, height_px, textScale }: PictureSize,
  signal: AbortSignal,
  more: PictureOptions,
  paper?: readonly number[],
): Promise<Blob> {
  const draw = overlay(paper);
  const { exportPicture } = await import("./map3d-print.module.js");
  return exportPicture(view, {
    width_px,
    height_px,
    textScale,
    signal,
    ...(draw && { overlay: draw }),
    progress: (done, total) => showProgress(done / total),
    ...more,
  });
}

async function save(context: PictureContext, size: PictureSize, signal: AbortSignal): Promise<void> {
  const legend = context.legend();
  const blob = await createPicture(context, size, signal, { title: titleOf(context), ...(legend && { legend }) });
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${context.json.name}-${context.view.direction}.png`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** Prints the picture with title, legend and attribution on a print-only sheet. */
async function print(context: PictureContext, size: PictureSize, signal: AbortSignal): Promise<void> {
  const blob = await createPicture(context, size, signal, { attribution: "", background: "#fff" }, [255, 255, 255]);
  const picture = new Image();
  picture.src = URL.createObjectURL(blob);
  picture.alt = titleOf(context);
  await picture.decode();
  const sheet = byId("sheet");
  sheet.replaceChildren(headOf(context), picture, ...legendOf(context.legend()), footOf(context));
  sheet.classList.toggle("wide", size.width_px >= size.height_px);
  sheet.hidden = false;
  addEventListener(
    "afterprint",
    () => {
      sheet.hidden = true;
      sheet.replaceChildren();
      URL.revokeObjectURL(picture.src);
    },
    { once: true },
  );
  window.print();
}

const titleOf = ({ json }: PictureContext): string => json.title || json.name;

function headOf(context: PictureContext): HTMLElement {
  const head = document.createElement("header");
  const date = withText("time", new Date().toLocaleDateString(language, { dateStyle: "long" }));
  date.dateTime = new Date().toISOString().slice(0, 10);
  head.append(withText("h1", titleOf(context)), date);
  return head;
}

function legendOf(legend: PictureLegend | undefined): HTMLElement[] {
  if (!legend) return [];
  const list = document.createElement("ul");
  for (const { label, color } of legend.chosen ?? legend.classes) {
    const [row, swatch] = [document.createElement("li"), document.createElement("i")];
    swatch.style.background = color;
    row.append(swatch, label);
    list.append(row);
  }
  const section = document.createElement("section");
  section.append(withText("h2", legend.title), list);
  return [section];
}

function footOf({ view, json }: PictureContext): HTMLElement {
  const crs = [json.crs.name, json.crs.vertical].filter(Boolean).join(", ");
  return withText("footer", [...view.attributions, crs && introduce("crs", crs)].filter(Boolean).join(" · "));
}
