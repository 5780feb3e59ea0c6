import { correction, generate } from "lean-qr/nano";
import { withText } from "./dom";
import type { MessageKey } from "./i18n";

/** Quiet zone around a QR code, modules. */
const QUIET = 4;
const NS = "http://www.w3.org/2000/svg";

type Message = (key: MessageKey) => string;

/** Opens the dialog that shares the view in the address: its link, code to embed it, and a QR code. */
export function openShareDialog(message: Message): void {
  const link = location.href;
  const dialog = document.createElement("dialog");
  dialog.className = "dialog";
  dialog.setAttribute("aria-labelledby", "share-title");
  const title = withText("h2", message("share"));
  title.id = "share-title";
  const form = document.createElement("form");
  form.method = "dialog";
  const actions = withText("div", "", "actions");
  if ("share" in navigator)
    actions.append(
      button(message("send"), () => {
        navigator.share({ title: document.title, url: link }).catch(() => undefined);
      }),
    );
  const close = withText("button", message("close"), "main");
  actions.append(close);
  form.append(
    title,
    copyable(message, "link", "share-link", link),
    copyable(message, "embedCode", "share-embed", iframeCode(link)),
    createQr(link, message("qrCode")),
    actions,
  );
  dialog.append(form);
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

const escaped = (text: string): string => text.replaceAll("&", "&amp;").replaceAll('"', "&quot;").replaceAll("<", "&lt;");

const iframeCode = (link: string): string =>
  `<iframe src="${escaped(link)}" title="${escaped(document.title)}" width="800" height="500" style="border:0" loading="lazy" allowfullscreen></iframe>`;

function button(text: string, act: () => void): HTMLButtonElement {
  const created = withText("button", text);
  created.type = "button";
  created.addEventListener("click", act);
  return created;
}

/** Creates a labelled text with a button that copies it; without the clipboard, it selects the text. */
function copyable(message: Message, label: MessageKey, id: string, value: string): HTMLElement {
  const [row, name, field] = [withText("div", "", "share-row"), withText("label", message(label)), document.createElement("input")];
  [name.htmlFor, field.id, field.readOnly, field.value] = [id, id, true, value];
  field.addEventListener("focus", () => field.select());
  const copy = button(message("copy"), () => {
    navigator.clipboard.writeText(value).then(
      () => {
        copy.textContent = message("copiedShort");
      },
      () => field.select(),
    );
  });
  copy.id = `${id}-copy`;
  row.append(name, field, copy);
  return row;
}

/** Draws a QR code: dark on white in every colour scheme, since readers expect that. */
function createQr(text: string, label: string): SVGSVGElement {
  const code = generate(text, { minCorrectionLevel: correction.M });
  const svg = document.createElementNS(NS, "svg");
  const side = String(code.size + 2 * QUIET);
  for (const [name, value] of Object.entries({
    viewBox: `${String(-QUIET)} ${String(-QUIET)} ${side} ${side}`,
    class: "share-qr",
    role: "img",
    "aria-label": label,
    "shape-rendering": "crispEdges",
  }))
    svg.setAttribute(name, value);
  const path = document.createElementNS(NS, "path");
  let shape = "";
  for (let y = 0; y < code.size; y++) for (let x = 0; x < code.size; x++) if (code.get(x, y)) shape += `M${String(x)} ${String(y)}h1v1h-1z`;
  path.setAttribute("d", shape);
  svg.append(path);
  return svg;
}
