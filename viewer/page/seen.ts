import type { imageLayer, map } from "./map3d.mjs";
import { byId, withText } from "./dom";
import { toast } from "./messages";
import { say } from "./i18n";

const SHOWN = 30;

/** A list of what is in view, the largest first: for those who read the page instead of seeing it, and for keyboards. */
export function bindSeen(view: map, layer: () => imageLayer, chose: (id: number) => void): void {
  const [button, box] = [byId("list-seen"), byId("seen")];
  const close = (): void => {
    box.hidden = true;
    button.setAttribute("aria-expanded", "false");
  };
  button.hidden = false;
  button.addEventListener("click", () => {
    named(view, layer()).then((rows) => {
      box.replaceChildren(withText("h2", say("inView")), rows.length > 0 ? listOf(rows, (id) => { close(); chose(id); }) : withText("p", say("nothingFound"), "note"));
      box.hidden = false;
      button.setAttribute("aria-expanded", "true");
      (box.querySelector("button") ?? box).focus();
    }, (reason: unknown) => { toast(String(reason)); });
  });
  box.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    event.stopPropagation();
    close();
    button.focus();
  });
}

type Row = readonly [id: number, name: string];

async function named(view: map, layer: imageLayer): Promise<Row[]> {
  const seen = (await view.objectsInView()).filter((seen) => seen.layer === layer).slice(0, SHOWN);
  return Promise.all(seen.map(async ({ id }) => [id, (await layer.object(id))?.name ?? `${say("object")} ${String(id)}`] as const));
}

function listOf(rows: readonly Row[], chose: (id: number) => void): HTMLElement {
  const list = document.createElement("ol");
  for (const [id, name] of rows) {
    const button = withText("button", name);
    button.type = "button";
    button.addEventListener("click", () => { chose(id); });
    const row = document.createElement("li");
    row.append(button);
    list.append(row);
  }
  return list;
}
