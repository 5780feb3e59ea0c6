/** Files by their paths, in the folder that holds rendering.json. */
export interface Folder {
  /** null when there is no such file. It is read in parts: a path may name gigabytes. */
  file(path: string): Promise<Blob | null>;
}

export const MANIFEST = "rendering.json";
/** Folders are searched for a manifest so far down, and so many at most: somebody may drop all that they have. */
const [DEPTH, SEARCHED] = [3, 1000] as const;

/** Where manifests lie among files, "" or ending with a slash; those inside another's folder do not count. */
export function basesOf(paths: Iterable<string>): string[] {
  const bases: string[] = [];
  for (const path of paths) if (path === MANIFEST || path.endsWith(`/${MANIFEST}`)) bases.push(path.slice(0, -MANIFEST.length));
  return bases.filter((base) => !bases.some((other) => other !== base && base.startsWith(other))).sort();
}

/** Of chosen files: below the folder that was chosen, else by their names alone. */
export const pathOf = (file: File): string => file.webkitRelativePath || file.name;

/** The part of some files that lies below a base. */
export function folderOf(files: ReadonlyMap<string, Blob>, base: string): Folder {
  return { file: (path) => Promise.resolve(files.get(base + path) ?? null) };
}

/** Does it name a file below a folder, and nothing else? */
export const isInside = (path: unknown): path is string => typeof path === "string" && path.split("/").every((part) => part !== "" && part !== "." && part !== ".." && !/[\\:\0]/.test(part));

/** Dropped files and folders, which are looked into when something of them is asked for. */
export class Dropped {
  readonly #roots: ReadonlyMap<string, FileSystemEntry>;

  constructor(entries: readonly FileSystemEntry[]) {
    this.#roots = new Map(entries.map((entry) => [entry.name, entry]));
  }

  /** Folders that hold a manifest, by their paths. */
  async search(): Promise<Map<string, Folder>> {
    const found = new Map<string, Folder>();
    if (this.#roots.get(MANIFEST)?.isFile === true) return found.set("", this.#folder(""));
    let level = [...this.#roots.values()].filter(isDirectory);
    for (let depth = 0, left = SEARCHED; depth < DEPTH && level.length > 0; depth++) {
      const next: FileSystemDirectoryEntry[] = [];
      for (const directory of level.slice(0, left)) {
        const path = `${directory.fullPath.replace(/^\/+/, "")}/`;
        if (await fileIn(directory, MANIFEST)) found.set(path, this.#folder(path));
        else if (depth < DEPTH - 1) next.push(...(await childrenOf(directory)).filter(isDirectory));
      }
      left -= level.length;
      level = left > 0 ? next : [];
    }
    return found;
  }

  #folder(base: string): Folder {
    return {
      file: async (path) => {
        const [first = "", ...rest] = (base + path).split("/");
        const root = this.#roots.get(first);
        if (!root) return null;
        const entry = isDirectory(root) && rest.length > 0 ? await fileIn(root, rest.join("/")) : root;
        return entry?.isFile === true ? await new Promise<File>((resolve, reject) => { (entry as FileSystemFileEntry).file(resolve, reject); }) : null;
      },
    };
  }
}

const isDirectory = (entry: FileSystemEntry): entry is FileSystemDirectoryEntry => entry.isDirectory;

/** null when there is none; other failures are the browser's. */
function fileIn(directory: FileSystemDirectoryEntry, path: string): Promise<FileSystemEntry | null> {
  return new Promise((resolve, reject) => {
    directory.getFile(path, {}, resolve, (error) => {
      if (error.name === "NotFoundError" || error.name === "TypeMismatchError") resolve(null);
      else reject(error);
    });
  });
}

/** Browsers tell a hundred or so at a time. */
async function childrenOf(directory: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
  const reader = directory.createReader();
  const all: FileSystemEntry[] = [];
  for (;;) {
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) => { reader.readEntries(resolve, reject); });
    if (some.length === 0) return all;
    all.push(...some);
  }
}
