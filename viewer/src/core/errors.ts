/** Base class of all errors of map3d. */
export class Map3dError extends Error {
  override name = "Map3dError";
}

/** rendering.json is missing, has another version, or is malformed. */
export class ManifestError extends Map3dError {
  override name = "ManifestError";
}

/** A tile, archive or attribute file could not be fetched. */
export class FetchError extends Map3dError {
  override name = "FetchError";
  /** HTTP status; 0 when the server did not answer. */
  readonly status: number;
  constructor(message: string, status = 0) {
    super(message);
    this.status = status;
  }
}

/** A tile's bytes do not match the manifest. */
export class DecodeError extends Map3dError {
  override name = "DecodeError";
}

/** The browser cannot draw: it lacks WebGL2, or a shader failed to compile. */
export class DrawError extends Map3dError {
  override name = "DrawError";
}

/** Wrong use of the API: an unknown element or view, or a number out of range. */
export class UsageError extends Map3dError {
  override name = "UsageError";
}

/** Whether the server does not have a file; S3 answers 403. */
export const isGone = (error: Error): boolean => error instanceof FetchError && [403, 404, 410].includes(error.status);

export function asError(reason: unknown): Error {
  return reason instanceof Error ? reason : new Map3dError(String(reason));
}
