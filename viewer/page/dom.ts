/** An element of index.html. */
export function byId(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (!found) throw new Error(`index.html has no element "${id}"; take the index.html of the same release`);
  return found;
}

/** An input of index.html. */
export function inputById(id: string): HTMLInputElement {
  const found = byId(id);
  if (!(found instanceof HTMLInputElement)) throw new Error(`element "${id}" of index.html is no input`);
  return found;
}

/** An element with text, never HTML. */
export function withText<K extends keyof HTMLElementTagNameMap>(tag: K, text: string, classes = ""): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  made.textContent = text;
  if (classes) made.className = classes;
  return made;
}
