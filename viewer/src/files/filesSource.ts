import { Archive, FetchError, Map3dError, readManifest, type LayerInfo, type Rendering, type Source, type Tile, type View } from "../map3d";
import { basesOf, folderOf, isInside, MANIFEST, pathOf, type Folder } from "./folder";
import { getFilesMessages, type FilesProblem } from "./i18n";

/** Files that are no whole rendering. */
export class FilesError extends Map3dError {
  override name = "FilesError";
  readonly problem: FilesProblem;
  /** Those it is about. */
  readonly paths: readonly string[];

  constructor(problem: FilesProblem, paths: readonly string[] = []) {
    super(getFilesMessages("en")[problem](named(paths)));
    [this.problem, this.paths] = [problem, paths];
  }
}

const NAMED = 3;

/** The first few. */
export const named = (paths: readonly string[]): string => paths.slice(0, NAMED).join(", ") + (paths.length > NAMED ? `, … (${String(paths.length)})` : "");

/** Whole files that are parsed, and parts of archives, are at most this large; beyond, they are none of ours. */
const [JSON_BYTES, PART_BYTES] = [256 << 20, 64 << 20] as const;

/**
 * A published rendering in files that a page was given, such as those of an input with `webkitdirectory`. Files are read in parts, as they are needed.
 * @throws FilesError when they have no rendering.json, or several
 */
export function filesSource(files: Iterable<File> | Folder): Source {
  if ("file" in files) return new FilesSource(files);
  const all = new Map(Array.from(files, (file) => [pathOf(file), file]));
  const [base, ...more] = basesOf(all.keys());
  if (base === undefined) throw new FilesError("none");
  if (more.length > 0) throw new FilesError("several", [base, ...more].map((path) => path + MANIFEST));
  return new FilesSource(folderOf(all, base));
}

class FilesSource implements Source {
  readonly #folder: Folder;
  readonly #archives = new Map<string, Archive>();
  /** Archives as they were when the manifest was read. */
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
    if (file.size > JSON_BYTES) throw new FetchError(`${path}: has ${String(file.size)} bytes, expected at most ${String(JSON_BYTES)}`);
    try {
      return JSON.parse(new TextDecoder().decode(await read(file, path))) as unknown;
    } catch (reason) {
      throw reason instanceof SyntaxError ? new FetchError(`${path}: expected JSON, got ${String(file.size)} bytes that are not`) : reason;
    }
  }

  async tile(view: View, layer: LayerInfo, { z, x, y }: Tile, signal?: AbortSignal): Promise<ArrayBuffer | null> {
    const archive = view.archives?.[layer.name];
    if (archive !== undefined) return this.#archive(archive).tile({ z, x, y }, signal);
    const path = [view.id, layer.name, z, x, y].join("/");
    const file = await this.#need(path);
    signal?.throwIfAborted();
    return read(file, path);
  }

  async #open(): Promise<Rendering> {
    const json = await this.json(MANIFEST);
    if (json === null) throw new FilesError("none");
    const rendering = readManifest(json, MANIFEST);
    const missing: string[] = [];
    for (const path of [...rendering.views.values()].flatMap(({ archives }) => Object.values(archives ?? {}))) {
      const file = await this.#file(path);
      if (file) this.#files.set(path, file);
      else missing.push(path);
    }
    if (missing.length > 0) throw new FilesError("missing", missing);
    return rendering;
  }

  #archive(path: string): Archive {
    const known = this.#archives.get(path);
    if (known) return known;
    const archive = new Archive(path, async (offset, length, signal) => {
      const whole = this.#files.get(path) ?? (await this.#need(path));
      signal?.throwIfAborted();
      // The first part may reach beyond the end of a small archive; no other does.
      if (offset > 0 && (length > PART_BYTES || offset + length > whole.size)) throw new FetchError(`${path}: has ${String(whole.size)} bytes and names ${String(length)} at ${String(offset)}; copy it again`);
      return read(whole.slice(offset, offset + length), path);
    });
    this.#archives.set(path, archive);
    return archive;
  }

  async #need(path: string): Promise<Blob> {
    const file = await this.#file(path);
    if (!file) throw new FilesError("missing", [path]);
    return file;
  }

  /** Names come from files of others: what is not below the folder is not there. */
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
    // NotReadableError, or NotFoundError: browsers refuse files that are other ones by now.
    throw new FilesError("changed", [path]);
  }
}
