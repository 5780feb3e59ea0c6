import { linkProgram } from "../../core/gl";
import { RECT_VERTEX } from "../../core/shaders";
import type { Program } from "../lightEstimator";
import { makeFragmentShader, variantName, type ShaderVariant } from "./shader";

const UNITS = ["u_color", "u_normal", "u_id", "u_depth", "u_table", "u_ao", "u_shadow", "u_styles"] as const;

/** Returns the texture unit of a sampler. */
export const textureUnit = (sampler: (typeof UNITS)[number]): number => UNITS.indexOf(sampler);

/** Programs by variant, compiled when first used. */
export class Programs {
  readonly #gl: WebGL2RenderingContext;
  readonly #known = new Map<string, Program>();

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
  }

  /** Makes a variant's program current. @throws DrawError with the compiler's log */
  use(variant: ShaderVariant): Program {
    const name = variantName(variant);
    const program = this.#known.get(name) ?? this.#link(variant, name);
    this.#known.set(name, program);
    this.#gl.useProgram(program.handle);
    return program;
  }

  #link(variant: ShaderVariant, name: string): Program {
    return this.#withUniforms(linkProgram(this.#gl, name, RECT_VERTEX, makeFragmentShader(variant)));
  }

  #withUniforms(handle: WebGLProgram): Program {
    const gl = this.#gl;
    const locations = new Map<string, WebGLUniformLocation | null>();
    const at = (uniform: string): WebGLUniformLocation | null => {
      const known = locations.get(uniform);
      if (known !== undefined) return known;
      const location = gl.getUniformLocation(handle, uniform);
      locations.set(uniform, location);
      return location;
    };
    gl.useProgram(handle);
    for (const sampler of UNITS) gl.uniform1i(at(sampler), textureUnit(sampler));
    return { handle, at };
  }
}
