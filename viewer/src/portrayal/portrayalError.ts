import { Map3dError } from "../core/errors";

/** A 3D Portrayal Service refuses a request, or its answer is not what the standard says. */
export class PortrayalError extends Map3dError {
  override name = "PortrayalError";
  /** Code of the service's exception, such as "InvalidParameterValue"; null without one. */
  readonly code: string | null;

  constructor(message: string, code: string | null = null) {
    super(message);
    this.code = code;
  }
}
