import type { ImageLayer, Map3D } from "./map3d.module.js";
import { describe, NOT_HIGHLIGHTED } from "./card";
import { byId, withText } from "./dom";
import { message } from "./i18n";
import { report } from "./toast";
import { findWhole, type Described } from "./whole";

const MAX_ROWS = 30;
/** Visible objects, parts included, that are read. */
const MAX_PARTS = 200;

/** Binds the list of objects in view, largest first: for screen readers and keyboards. */
export function bindInViewList(view: Map3D, layer: () => ImageLayer, select: (id: number) => void): void {
  const [button, box] = [byId("list-in-view"), byId("in-view")];
  const close = (): void => {
    box.hidden = true;
    button.setAttribute("aria-expanded", "false");
  };
  button.hidden = false;
  button.addEventListener("click", () => {
    objectsInView(view, layer()).then(
      (rows) => {
        box.replaceChildren(
          withText("h2", message("inView")),
          rows.length > 0
            ? listOf(rows, (id) => {
                close();
                select(id);
              })
            : withText("p", message("noObjects"), "note"),
        );
        box.hidden = false;
        button.setAttribute("aria-expanded", "true");
        (box.querySelector("button") ?? box).focus();
      },
      (reason: unknown) => report(reason),
    );
  });
  box.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    event.stopPropagation();
    close();
    button.focus();
  });
}

type ListRow = readonly [id: number, name: string];

/** Lists the largest objects, each with all its parts once, without the ground. */
async function objectsInView(view: Map3D, layer: ImageLayer): Promise<ListRow[]> {
  const visible = (await view.objectsInView()).filter((object) => object.layer === layer).slice(0, MAX_PARTS);
  const wholes = await Promise.all(visible.map(({ id }) => findWhole<Described>(layer, { id })));
  const named = wholes
    .filter((whole) => !NOT_HIGHLIGHTED.has(whole.class ?? ""))
    .map((whole) => [whole.id, describe(whole).title] as const);
  return [...new Map(named)].slice(0, MAX_ROWS);
}

function listOf(rows: readonly ListRow[], select: (id: number) => void): HTMLElement {
  const list = document.createElement("ol");
  for (const [id, name] of rows) {
    const button = withText("button", name);
    button.type = "button";
    button.addEventListener("click", () => select(id));
    const row = document.createElement("li");
    row.append(button);
    list.append(row);
  }
  return list;
}
