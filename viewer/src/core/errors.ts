/** Base of every error map3d raises. */
export class Map3dError extends Error {
  override name = "Map3dError";
}

/** rendering.json is missing, of another version, or breaks its contract. */
export class ManifestError extends Map3dError {
  override name = "ManifestError";
}

/** A tile, archive or attribute file could not be fetched. */
export class FetchError extends Map3dError {
  override name = "FetchError";
  /** HTTP status, 0 when no answer came. */
  readonly status: number;
  constructor(message: string, status = 0) {
    super(message);
    this.status = status;
  }
}

/** Bytes that are not what the manifest says they are. */
export class DecodeError extends Map3dError {
  override name = "DecodeError";
}

/** The browser cannot draw: no WebGL2, a shader refused. */
export class DrawError extends Map3dError {
  override name = "DrawError";
}

/** A caller's misuse: an unknown element, view, or number out of range. */
export class UsageError extends Map3dError {
  override name = "UsageError";
}

export function asError(reason: unknown): Error {
  return reason instanceof Error ? reason : new Map3dError(String(reason));
}
