/** The folder that contains rendering.json, with its files by path. */
export interface Folder {
  /** Returns a file, or null when there is none. The file can have gigabytes; it is read in parts. */
  file(path: string): Promise<Blob | null>;
}

export const MANIFEST = "rendering.json";
/** Greatest depth and number of folders that are searched for a manifest: a user can drop a whole disk. */
const [MAX_DEPTH, MAX_FOLDERS] = [3, 1000] as const;

/** Returns the folders that contain a manifest, each "" or ending with a slash. Ignores manifests below another one's folder. */
export function findManifestFolders(paths: Iterable<string>): string[] {
  const folders: string[] = [];
  for (const path of paths) if (path === MANIFEST || path.endsWith(`/${MANIFEST}`)) folders.push(path.slice(0, -MANIFEST.length));
  return folders.filter((base) => !folders.some((other) => other !== base && base.startsWith(other))).sort();
}

/** Path of a chosen file: relative to the chosen folder, else the file name. */
export const relativePath = (file: File): string => file.webkitRelativePath || file.name;

/** Returns the files below a folder. */
export function subfolder(files: ReadonlyMap<string, Blob>, base: string): Folder {
  return { file: (path) => Promise.resolve(files.get(base + path) ?? null) };
}

/** Is this the path of a file below the folder, with no way out of it? */
export const isInside = (path: unknown): path is string =>
  typeof path === "string" && path.split("/").every((part) => part !== "" && part !== "." && part !== ".." && !/[\\:\0]/.test(part));

/** Dropped files and folders, read on demand. */
export class DroppedEntries {
  readonly #roots: ReadonlyMap<string, FileSystemEntry>;

  constructor(entries: readonly FileSystemEntry[]) {
    this.#roots = new Map(entries.map((entry) => [entry.name, entry]));
  }

  /** Returns the folders that contain a manifest, by path. */
  async findFolders(): Promise<Map<string, Folder>> {
    const found = new Map<string, Folder>();
    if (this.#roots.get(MANIFEST)?.isFile === true) return found.set("", this.#folder(""));
    let level = [...this.#roots.values()].filter(isDirectory);
    for (let depth = 0, remaining = MAX_FOLDERS; depth < MAX_DEPTH && level.length > 0; depth++) {
      const next: FileSystemDirectoryEntry[] = [];
      for (const directory of level.slice(0, remaining)) {
        const path = `${directory.fullPath.replace(/^\/+/, "")}/`;
        if (await getFile(directory, MANIFEST)) found.set(path, this.#folder(path));
        else if (depth < MAX_DEPTH - 1) next.push(...(await readEntries(directory)).filter(isDirectory));
      }
      remaining -= level.length;
      level = remaining > 0 ? next : [];
    }
    return found;
  }

  #folder(base: string): Folder {
    return {
      file: async (path) => {
        const [first = "", ...rest] = (base + path).split("/");
        const root = this.#roots.get(first);
        if (!root) return null;
        const entry = isDirectory(root) && rest.length > 0 ? await getFile(root, rest.join("/")) : root;
        return entry?.isFile === true
          ? await new Promise<File>((resolve, reject) => (entry as FileSystemFileEntry).file(resolve, reject))
          : null;
      },
    };
  }
}

const isDirectory = (entry: FileSystemEntry): entry is FileSystemDirectoryEntry => entry.isDirectory;

/** Returns null when there is no such file. */
function getFile(directory: FileSystemDirectoryEntry, path: string): Promise<FileSystemEntry | null> {
  return new Promise((resolve, reject) => {
    directory.getFile(path, {}, resolve, (error) => {
      if (error.name === "NotFoundError" || error.name === "TypeMismatchError") resolve(null);
      else reject(error);
    });
  });
}

/** Returns all entries of a directory; browsers return about a hundred per call. */
async function readEntries(directory: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
  const reader = directory.createReader();
  const all: FileSystemEntry[] = [];
  for (;;) {
    const batch = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (batch.length === 0) return all;
    all.push(...batch);
  }
}
