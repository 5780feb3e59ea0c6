import { buildIdTable, computeTextureSize, type IdTable } from "./idTable";
import type { Program } from "../lightEstimator";
import { textureUnit } from "./program";
import { SPARE_UNIT } from "./textures";

type Values = ReadonlyMap<number, unknown>;

/** Tables by object id as textures, uploaded when first used. */
export class IdTextures {
  readonly #gl: WebGL2RenderingContext;
  readonly #known = new Map<Values, { table: IdTable; texture: WebGLTexture }>();

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
  }

  /** Binds a table, made from the values if it is new. @param uniforms sampler, mask and probes  @param pack converts a value to uint32 */
  bind<V>(
    program: Program,
    [sampler, mask, probes]: readonly ["u_table" | "u_styles", string, string],
    values: ReadonlyMap<number, V>,
    pack: (value: V) => number,
  ): void {
    const gl = this.#gl;
    const { table, texture } = this.#known.get(values) ?? this.#upload(values, buildIdTable(values, pack));
    gl.activeTexture(gl.TEXTURE0 + textureUnit(sampler));
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.uniform1ui(program.at(mask), table.mask);
    gl.uniform1i(program.at(probes), table.probes);
  }

  /** Frees the tables of all other maps. */
  freeAllBut(used: ReadonlySet<Values>): void {
    for (const [values, { texture }] of this.#known) {
      if (used.has(values)) continue;
      this.#gl.deleteTexture(texture);
      this.#known.delete(values);
    }
  }

  #upload(values: Values, table: IdTable): { table: IdTable; texture: WebGLTexture } {
    const gl = this.#gl;
    const texture = gl.createTexture();
    const [width, height] = computeTextureSize(table);
    gl.activeTexture(gl.TEXTURE0 + SPARE_UNIT);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RG32UI, width, height, 0, gl.RG_INTEGER, gl.UNSIGNED_INT, table.slots);
    this.#known.set(values, { table, texture });
    return { table, texture };
  }
}
