import {
  Archive,
  FetchError,
  Map3dError,
  readManifest,
  type LayerInfo,
  type ReadRange,
  type Rendering,
  type Source,
  type Tile,
  type View,
} from "../map3d";
import { findManifestFolders, isInside, MANIFEST, relativePath, subfolder, type Folder } from "./folder";
import { getFilesMessages, type FilesProblem } from "./i18n";

/** The files are not a complete published rendering. */
export class FilesError extends Map3dError {
  override name = "FilesError";
  readonly problem: FilesProblem;
  /** The affected paths. */
  readonly paths: readonly string[];

  constructor(problem: FilesProblem, paths: readonly string[] = []) {
    super(getFilesMessages("en")[problem](joinPaths(paths)));
    [this.problem, this.paths] = [problem, paths];
  }
}

const MAX_PATHS = 3;

/** Joins the first few paths. */
export const joinPaths = (paths: readonly string[]): string =>
  paths.slice(0, MAX_PATHS).join(", ") + (paths.length > MAX_PATHS ? `, … (${String(paths.length)})` : "");

/** Largest accepted JSON file and archive part. Larger ones do not come from map3d. */
const [MAX_JSON_BYTES, MAX_PART_BYTES] = [256 << 20, 64 << 20] as const;

/**
 * Reads a published rendering from files, such as those of an input with `webkitdirectory`. Files are read in parts, as needed.
 * @throws FilesError when there is no rendering.json, or more than one
 */
export function filesSource(files: Iterable<File> | Folder): Source {
  if ("file" in files) return new FilesSource(files);
  const all = new Map(Array.from(files, (file) => [relativePath(file), file]));
  const [base, ...more] = findManifestFolders(all.keys());
  if (base === undefined) throw new FilesError("none");
  if (more.length > 0)
    throw new FilesError(
      "several",
      [base, ...more].map((path) => path + MANIFEST),
    );
  return new FilesSource(subfolder(all, base));
}

class FilesSource implements Source {
  readonly #folder: Folder;
  readonly #archives = new Map<string, Archive>();
  /** Files of the archives when the manifest was read. */
  readonly #files = new Map<string, Blob>();
  #manifest: Promise<Rendering> | undefined;

  constructor(folder: Folder) {
    this.#folder = folder;
  }

  manifest(): Promise<Rendering> {
    return (this.#manifest ??= this.#open());
  }

  async json(path: string): Promise<unknown> {
    const file = await this.#file(path);
    if (!file) return null;
    if (file.size > MAX_JSON_BYTES)
      throw new FetchError(`${path}: expected at most ${String(MAX_JSON_BYTES)} bytes, got ${String(file.size)}`);
    try {
      return JSON.parse(new TextDecoder().decode(await read(file, path))) as unknown;
    } catch (reason) {
      throw reason instanceof SyntaxError
        ? new FetchError(`${path}: expected JSON, got ${String(file.size)} bytes of invalid JSON`)
        : reason;
    }
  }

  async tile(view: View, layer: LayerInfo, { z, x, y }: Tile, signal?: AbortSignal): Promise<ArrayBuffer | null> {
    const archive = view.archives?.[layer.name];
    if (archive !== undefined) return this.#archive(archive, view.part_bytes).tile({ z, x, y }, signal);
    const path = [view.id, layer.name, z, x, y].join("/");
    const file = await this.#requireFile(path);
    signal?.throwIfAborted();
    return read(file, path);
  }

  async #open(): Promise<Rendering> {
    const json = await this.json(MANIFEST);
    if (json === null) throw new FilesError("none");
    const rendering = readManifest(json, MANIFEST);
    const missing: string[] = [];
    const archives = [...rendering.views.values()].flatMap((view) => Object.values(view.archives ?? {}));
    for (const path of rendering.json.archive_part_bytes ? archives.map((archive) => Archive.partName(archive, 0)) : archives) {
      const file = await this.#file(path);
      if (file) this.#files.set(path, file);
      else missing.push(path);
    }
    if (missing.length > 0) throw new FilesError("missing", missing);
    return rendering;
  }

  #archive(path: string, part_bytes?: number): Archive {
    const known = this.#archives.get(path);
    if (known) return known;
    const archive = new Archive(path, (file) => this.#reader(file), part_bytes);
    this.#archives.set(path, archive);
    return archive;
  }

  #reader(path: string): ReadRange {
    return async (offset, length, signal) => {
      const whole = this.#files.get(path) ?? (await this.#requireFile(path));
      signal?.throwIfAborted();
      // Only the first part may reach beyond the end of a small archive.
      if (offset > 0 && (length > MAX_PART_BYTES || offset + length > whole.size))
        throw new FetchError(
          `${path}: expected ${String(length)} bytes at ${String(offset)}, but the file has ${String(whole.size)} bytes; copy the file again`,
        );
      return read(whole.slice(offset, offset + length), path);
    };
  }

  async #requireFile(path: string): Promise<Blob> {
    const file = await this.#file(path);
    if (!file) throw new FilesError("missing", [path]);
    return file;
  }

  /** Returns null for a path outside the folder: paths come from untrusted files. */
  async #file(path: string): Promise<Blob | null> {
    try {
      return isInside(path) ? await this.#folder.file(path) : null;
    } catch {
      throw new FilesError("changed", [path]);
    }
  }
}

async function read(blob: Blob, path: string): Promise<ArrayBuffer> {
  try {
    return await blob.arrayBuffer();
  } catch {
    // NotReadableError or NotFoundError: browsers refuse to read files that have changed.
    throw new FilesError("changed", [path]);
  }
}
