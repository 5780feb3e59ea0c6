/** An element of index.html. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`index.html has no element "${id}"; take the index.html of the same release`);
  return found as T;
}

/** An element with text, never HTML. */
export function withText<K extends keyof HTMLElementTagNameMap>(tag: K, text: string, classes = ""): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  made.textContent = text;
  if (classes) made.className = classes;
  return made;
}
