// The share dialog of a served map: a link that shows a picture of this very view in messengers, code to embed the map, the picture, and a QR code.

const TEXTS = {
  en: { title: "Share view", link: "Link", embed: "Embed code", picture: "Image", qr: "QR code", copy: "Copy", copied: "Copied", open: "Open", save: "Save", close: "Close", send: "Send…" },
  de: { title: "Ansicht teilen", link: "Link", embed: "Code zum Einbetten", picture: "Bild", qr: "QR-Code", copy: "Kopieren", copied: "Kopiert", open: "Öffnen", save: "Speichern", close: "Schließen", send: "Senden\u00a0…" },
  fr: { title: "Partager la vue", link: "Lien", embed: "Code d’intégration", picture: "Image", qr: "Code QR", copy: "Copier", copied: "Copié", open: "Ouvrir", save: "Enregistrer", close: "Fermer", send: "Envoyer…" },
};
let texts = TEXTS.en;
const COPIED_MS = 2000;
const PICTURE_SIZE = "1200x630";

/** Returns the folder of the page, `…/view/<rendering>/`, and the rendering's name. */
function place() {
  const folder = new URL(".", location.href);
  return { folder, rendering: folder.pathname.split("/").at(-2) };
}

/** Returns the addresses of the view that the page's fragment names; null before the map has one. */
function addresses() {
  const view = decodeURIComponent(location.hash.slice(1));
  const [direction, x, y, z, zoom, ...more] = view.split("/");
  if (zoom === undefined) return null;
  const { folder, rendering } = place();
  const query = encodeURIComponent(view).replaceAll("%2F", "/").replaceAll("%3D", "=").replaceAll("%3A", ":");
  const link = new URL(`?view=${query}`, folder).href;
  const time = more.find((part) => part.startsWith("t="));
  return {
    link,
    picture: new URL(`../../pictures/${rendering}/${x},${y},${zoom},${direction.replace("-", ",")},${z}/${PICTURE_SIZE}.jpg${time ? `?${time}` : ""}`, folder).href,
    qr: new URL(`qr.svg?view=${query}`, folder).href,
    embed: `<iframe src="${escaped(link)}" title="${escaped(document.title)}" width="800" height="500" style="border:0" loading="lazy" allowfullscreen></iframe>`,
  };
}

const escaped = (text) => text.replaceAll("&", "&amp;").replaceAll('"', "&quot;").replaceAll("<", "&lt;");

/** Creates an element with attributes and children. */
function element(tag, attributes = {}, ...children) {
  const created = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) created.setAttribute(name, value);
  created.append(...children);
  return created;
}

/** Creates a labelled text with a button that copies it. */
function copyable(label, value, id, rows = 1) {
  const field = rows > 1 ? element("textarea", { id, readonly: "", rows: String(rows), spellcheck: "false" }) : element("input", { id, readonly: "", type: "text", spellcheck: "false" });
  field.value = value;
  field.addEventListener("focus", () => { field.select(); });
  const button = element("button", { type: "button", "aria-label": `${texts.copy}: ${label}` }, texts.copy);
  button.addEventListener("click", () => { copy(field, button); });
  return element("div", { class: "share-row" }, element("label", { for: id }, label), element("div", { class: "share-field" }, field, button));
}

async function copy(field, button) {
  try {
    await navigator.clipboard.writeText(field.value);
  } catch {
    field.select(); // pages without https have no clipboard; the user copies the selected text
    return;
  }
  button.textContent = texts.copied;
  setTimeout(() => { button.textContent = texts.copy; }, COPIED_MS);
}

function showDialog(found) {
  const close = element("button", { type: "submit", value: "close", class: "main" }, texts.close);
  const actions = element("div", { class: "actions" });
  if ("share" in navigator) {
    const send = element("button", { type: "button" }, texts.send);
    send.addEventListener("click", () => { navigator.share({ title: document.title, url: found.link }).catch(() => undefined); });
    actions.append(send);
  }
  actions.append(close);
  const qr = element("a", { href: found.qr, download: "qr.svg", class: "share-qr", title: texts.save }, element("img", { src: found.qr, alt: texts.qr, width: "132", height: "132" }));
  const image = element("a", { href: found.picture, target: "_blank", rel: "noopener", class: "share-picture", title: texts.open }, element("img", { src: found.picture, alt: texts.picture, width: "252", height: "132" }));
  const form = element("form", { method: "dialog" },
    element("h2", { id: "share-title" }, texts.title),
    copyable(texts.link, found.link, "share-link"),
    copyable(texts.embed, found.embed, "share-embed", 3),
    element("div", { class: "share-images" }, element("figure", {}, image, element("figcaption", {}, texts.picture)), element("figure", {}, qr, element("figcaption", {}, texts.qr))),
    actions);
  const dialog = element("dialog", { class: "dialog share-dialog", "aria-labelledby": "share-title" }, form);
  dialog.addEventListener("close", () => { dialog.remove(); });
  document.body.append(dialog);
  dialog.showModal();
}

// Before the page's own listener, which shares the plain link.
document.addEventListener("click", (event) => {
  const button = event.target instanceof Element ? event.target.closest("#share") : null;
  const found = button && addresses();
  if (!found) return;
  event.stopImmediatePropagation();
  event.preventDefault();
  texts = TEXTS[document.documentElement.lang.slice(0, 2)] ?? TEXTS.en;
  showDialog(found);
}, true);
