import type { map, ManifestJson } from "./map3d.mjs";
import type { PictureLegend, PictureOptions } from "./map3d-print.mjs";
import { byId, withText } from "./dom";
import { language, say } from "./i18n";

type Side = readonly [long: number, short: number];

/** Long and short side at 300 dpi, picture pixels. */
const PAPERS: readonly (readonly [name: string, side: Side])[] = [["A4", [3508, 2480]], ["A3", [4961, 3508]]];
const SCALES = [1, 2, 4];
const PAPER_SCALE = 300 / 96;
const LONGEST_SIDE_PX = 8192;

/** What the picture is of. */
export interface Shown {
  readonly view: map;
  readonly json: ManifestJson;
  /** Of the colours, when there are any. */
  legend(): PictureLegend | undefined;
}

interface Size {
  readonly name: string;
  readonly width_px: number;
  readonly height_px: number;
  readonly textScale: number;
}

/** A dialog that makes a picture of what is seen: a file, or on paper. */
export function bindPicture(shown: Shown): void {
  const [button, dialog, select] = [byId("make-picture"), byId("picture") as HTMLDialogElement, byId("picture-size") as HTMLSelectElement];
  let sizes: readonly Size[] = [];
  let making: AbortController | undefined;
  const note = (): void => {
    const size = sizes[select.selectedIndex];
    byId("picture-note").textContent = size ? `${String(size.width_px)} × ${String(size.height_px)} px` : "";
  };
  const make = (act: (size: Size, signal: AbortSignal) => Promise<void>): void => {
    const size = sizes[select.selectedIndex];
    if (!size) return;
    making = new AbortController();
    const { signal } = making;
    sayFailed("");
    work(true);
    act(size, signal).then(() => { dialog.close(); }, (reason: unknown) => {
      if (!signal.aborted) sayFailed(`${say("noPicture")}: ${reason instanceof Error ? reason.message : String(reason)}`);
    }).finally(() => { work(false); });
  };
  button.addEventListener("click", () => {
    const at = Math.max(select.selectedIndex, 0);
    sizes = sizesOf(shown.view.canvas);
    select.replaceChildren(...sizes.map(({ name }) => new Option(name)));
    select.selectedIndex = Math.min(at, sizes.length - 1);
    note();
    sayFailed("");
    dialog.showModal();
  });
  select.addEventListener("change", note);
  dialog.addEventListener("close", () => { making?.abort(); });
  byId("picture-save").addEventListener("click", () => { make((size, signal) => save(shown, size, signal)); });
  byId("picture-print").addEventListener("click", () => { make((size, signal) => print(shown, size, signal)); });
}

function sizesOf({ clientWidth: width, clientHeight: height }: HTMLCanvasElement): Size[] {
  const screens = SCALES.map((scale) => ({ name: `${say("screen")} × ${String(scale)}`, width_px: width * scale, height_px: height * scale, textScale: scale }));
  const papers = PAPERS.map(([name, [long, short]]) => ({
    name: `${name}, 300 dpi`, width_px: width < height ? short : long, height_px: width < height ? long : short, textScale: PAPER_SCALE,
  }));
  return [...screens.filter(({ width_px, height_px }) => Math.max(width_px, height_px) <= LONGEST_SIDE_PX), ...papers];
}

function sayFailed(text: string): void {
  byId("picture-failed").textContent = text;
  byId("picture-failed").hidden = text === "";
}

function work(on: boolean): void {
  byId("picture-working").hidden = !on;
  for (const id of ["picture-save", "picture-print", "picture-size"]) (byId(id) as HTMLButtonElement | HTMLSelectElement).disabled = on;
  showShare(0);
}

function showShare(share: number): void {
  (byId("picture-progress") as HTMLProgressElement).value = share;
  byId("picture-share").textContent = share.toLocaleString(language, { style: "percent" });
}

async function pictureOf({ view }: Shown, { width_px, height_px, textScale }: Size, signal: AbortSignal, more: PictureOptions): Promise<Blob> {
  const { exportPicture } = await import("./map3d-print.mjs");
  return exportPicture(view, { width_px, height_px, textScale, signal, progress: (done, all) => { showShare(done / all); }, ...more });
}

async function save(shown: Shown, size: Size, signal: AbortSignal): Promise<void> {
  const legend = shown.legend();
  const blob = await pictureOf(shown, size, signal, { title: titleOf(shown), ...(legend && { legend }) });
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${shown.json.name}-${shown.view.direction}.png`;
  link.click();
  setTimeout(() => { URL.revokeObjectURL(link.href); }, 60_000);
}

/** The picture with title, legend and what else must be said, on a sheet that only paper shows. */
async function print(shown: Shown, size: Size, signal: AbortSignal): Promise<void> {
  const blob = await pictureOf(shown, size, signal, { attribution: "", background: "#fff" });
  const picture = new Image();
  picture.src = URL.createObjectURL(blob);
  picture.alt = titleOf(shown);
  await picture.decode();
  const sheet = byId("sheet");
  sheet.replaceChildren(headOf(shown), picture, ...legendOf(shown.legend()), footOf(shown));
  sheet.classList.toggle("wide", size.width_px >= size.height_px);
  sheet.hidden = false;
  addEventListener("afterprint", () => {
    sheet.hidden = true;
    sheet.replaceChildren();
    URL.revokeObjectURL(picture.src);
  }, { once: true });
  window.print();
}

const titleOf = ({ json }: Shown): string => json.title || json.name;

function headOf(shown: Shown): HTMLElement {
  const head = document.createElement("header");
  const date = withText("time", new Date().toLocaleDateString(language, { dateStyle: "long" }));
  date.dateTime = new Date().toISOString().slice(0, 10);
  head.append(withText("h1", titleOf(shown)), date);
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

function footOf({ view, json }: Shown): HTMLElement {
  const crs = [json.crs.name, json.crs.vertical].filter(Boolean).join(", ");
  return withText("footer", [...view.attributions, crs && `${say("crs")}: ${crs}`].filter(Boolean).join(" · "));
}
