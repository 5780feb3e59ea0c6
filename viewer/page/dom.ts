/** Returns an element of index.html. */
export function byId(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (!found) throw new Error(`index.html has no element "${id}"; use the index.html of the same release`);
  return found;
}

/** Returns an input of index.html. */
export function inputById(id: string): HTMLInputElement {
  const found = byId(id);
  if (!(found instanceof HTMLInputElement)) throw new Error(`element "${id}" of index.html is not an input`);
  return found;
}

/** Creates an element with text content. */
export function withText<K extends keyof HTMLElementTagNameMap>(tag: K, text: string, classes = ""): HTMLElementTagNameMap[K] {
  const created = document.createElement(tag);
  created.textContent = text;
  if (classes) created.className = classes;
  return created;
}

/** Events with which a user takes over from a movement of the page's own. */
export const GESTURES = ["pointerdown", "wheel", "keydown"] as const;
