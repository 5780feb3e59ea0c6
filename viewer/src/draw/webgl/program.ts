import { linkProgram } from "../../core/gl";
import { RECT_VERTEX } from "../../core/shaders";
import { makeFragmentShader, variantName, type ShaderVariant } from "./shader";

/** A linked program and where its uniforms are; those it does not use are null, which WebGL ignores. */
export interface Program {
  readonly handle: WebGLProgram;
  at(uniform: string): WebGLUniformLocation | null;
}

const UNITS = ["u_color", "u_normal", "u_id", "u_depth", "u_table", "u_ao", "u_shadow", "u_finishes", "u_shares"] as const;

/** Texture unit of a sampler. */
export const textureUnit = (sampler: (typeof UNITS)[number]): number => UNITS.indexOf(sampler);

/** Programs by variant, compiled when first asked for. */
export class Programs {
  readonly #gl: WebGL2RenderingContext;
  readonly #known = new Map<string, Program>();

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
  }

  /** The program of a variant, in use from now on. @throws DrawError with the compiler's log */
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
    const places = new Map<string, WebGLUniformLocation | null>();
    const at = (uniform: string): WebGLUniformLocation | null => {
      const known = places.get(uniform);
      if (known !== undefined) return known;
      const place = gl.getUniformLocation(handle, uniform);
      places.set(uniform, place);
      return place;
    };
    gl.useProgram(handle);
    for (const sampler of UNITS) gl.uniform1i(at(sampler), textureUnit(sampler));
    return { handle, at };
  }
}
