import { DrawError } from "../../core/errors";
import { towardsLight } from "../../geo/light";
import type { LayerKind } from "../../geo/manifest";
import { neededKinds, type Drawer, type DrawerEvents, type FrameSpec, type Mode, type Pass, type Quad } from "../drawer";
import { idTable, tableShape, type IdTable } from "./idTable";
import { Programs, unitOf, type Program } from "./program";
import { boundsOf, SPARE_UNIT, Textures, type TileTexture } from "./textures";

const SAMPLERS = { color: "u_color", normal: "u_normal", id: "u_id", depth: "u_depth" } as const;

export interface WebGLOptions {
  /** Keep the picture readable after a frame: for tests and screenshots; costs memory. */
  preserve: boolean;
}

/** Draws with WebGL2: one quad a tile, light and highlights in the shader. */
export class WebGLDrawer implements Drawer {
  readonly name = "webgl";
  readonly busy = false;
  readonly note = "";
  readonly #gl: WebGL2RenderingContext;
  readonly #canvas: HTMLCanvasElement;
  readonly #listeners = new AbortController();
  #programs: Programs;
  #textures: Textures;
  #tables = new Map<ReadonlyMap<number, unknown>, { table: IdTable; texture: WebGLTexture }>();

  /** @throws DrawError when the browser has no WebGL2 */
  constructor(canvas: HTMLCanvasElement, options: WebGLOptions, events: DrawerEvents) {
    const settings: WebGLContextAttributes = { alpha: true, premultipliedAlpha: true, antialias: false, depth: false, stencil: false, preserveDrawingBuffer: options.preserve };
    const gl = canvas.getContext("webgl2", settings);
    if (!gl) throw new DrawError("this browser offers no WebGL2, which the map needs to draw; update it or switch hardware acceleration on");
    this.#gl = gl;
    this.#canvas = canvas;
    this.#programs = new Programs(gl);
    this.#textures = new Textures(gl);
    this.#watch(events);
  }

  draw(frame: FrameSpec): void {
    const gl = this.#gl;
    if (gl.isContextLost()) return;
    gl.viewport(0, 0, frame.width, frame.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    for (const pass of frame.passes) this.#drawPass(frame, pass);
    this.#dropTables(frame.passes);
  }

  release(key: string): void {
    this.#textures.release(key);
  }

  destroy(): void {
    this.#listeners.abort();
    this.#textures.clear();
    this.#dropTables([]);
  }

  #drawPass(frame: FrameSpec, pass: Pass): void {
    const mode: Mode = pass.mode === "lit" && !frame.light.lit ? "color" : pass.mode;
    const kinds = neededKinds(mode, pass.masked);
    const wanted = pass.highlight.size > 0;
    // All are uploaded before the first is drawn, so that gutters have their neighbours' pixels.
    const ready = pass.quads.map((quad) => ({
      quad,
      textures: kinds.map((kind) => [kind, this.#textureOf(pass, kind, quad)] as const),
      ids: wanted ? this.#textureOf(pass, "id", quad) : undefined,
    }));
    for (const { quad, textures, ids } of ready) {
      if (textures.some(([, texture]) => !texture)) continue;
      const program = this.#programs.use({ mode, masked: pass.masked, highlight: ids !== undefined });
      for (const [kind, texture] of textures) this.#bind(kind, texture);
      if (ids) this.#bindHighlight(program, pass, quad, ids, frame.dpr);
      this.#drawQuad(frame, pass, quad, program, textures[0]?.[1]);
    }
  }

  #textureOf(pass: Pass, kind: LayerKind, { from }: Quad): TileTexture | undefined {
    const key = pass.tiles.key(kind, from);
    const known = this.#textures.get(key);
    if (known) return known;
    const data = pass.tiles.data(kind, from);
    if (!data) return undefined;
    const neighbour = (dx: number, dy: number): string => pass.tiles.key(kind, { z: from.z, x: from.x + dx, y: from.y + dy });
    const texture = this.#textures.upload(key, data, neighbour);
    pass.tiles.taken(kind, from);
    return texture;
  }

  #bind(kind: LayerKind, texture: TileTexture | undefined): void {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0 + unitOf(SAMPLERS[kind]));
    gl.bindTexture(gl.TEXTURE_2D, texture?.texture ?? null);
  }

  #drawQuad(frame: FrameSpec, pass: Pass, quad: Quad, program: Program, texture: TileTexture | undefined): void {
    const gl = this.#gl;
    const { width, height, light } = frame;
    const [left, top, right, bottom] = quad.rect;
    const [x, y] = [(at: number): number => (at / width) * 2 - 1, (at: number): number => 1 - (at / height) * 2];
    gl.uniform4f(program.at("u_rect"), x(left), y(top), x(right), y(bottom));
    gl.uniform1f(program.at("u_height"), height);
    gl.uniform2f(program.at("u_origin"), ...quad.origin);
    gl.uniform1f(program.at("u_scale"), quad.scale);
    gl.uniform1i(program.at("u_size"), texture?.width ?? 0);
    if (texture) gl.uniform4i(program.at("u_bounds"), ...boundsOf(texture));
    gl.uniform1f(program.at("u_opacity"), pass.opacity);
    gl.uniform3f(program.at("u_sun"), ...towardsLight(light));
    gl.uniform2f(program.at("u_light"), light.ambient, light.diffuse);
    gl.uniform2f(program.at("u_range"), ...pass.depthRange);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  #bindHighlight(program: Program, pass: Pass, quad: Quad, ids: TileTexture, dpr: number): void {
    const gl = this.#gl;
    const { table, texture } = this.#tables.get(pass.highlight) ?? this.#uploadTable(pass);
    this.#bind("id", ids);
    gl.activeTexture(gl.TEXTURE0 + unitOf("u_table"));
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.uniform1ui(program.at("u_mask"), table.mask);
    gl.uniform1i(program.at("u_probes"), table.probes);
    gl.uniform2ui(program.at("u_one"), ...table.one);
    gl.uniform1f(program.at("u_rim"), Math.max(1, 1.25 * dpr * quad.scale));
  }

  #uploadTable(pass: Pass): { table: IdTable; texture: WebGLTexture } {
    const gl = this.#gl;
    const table = idTable(pass.highlight);
    const texture = gl.createTexture();
    const [width, height] = tableShape(table);
    gl.activeTexture(gl.TEXTURE0 + SPARE_UNIT);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RG32UI, width, height, 0, gl.RG_INTEGER, gl.UNSIGNED_INT, table.places);
    this.#tables.set(pass.highlight, { table, texture });
    return { table, texture };
  }

  #dropTables(passes: readonly Pass[]): void {
    for (const [highlight, { texture }] of this.#tables) {
      if (passes.some((pass) => pass.highlight === highlight)) continue;
      this.#gl.deleteTexture(texture);
      this.#tables.delete(highlight);
    }
  }

  #watch(events: DrawerEvents): void {
    const { signal } = this.#listeners;
    const lost = (event: Event): void => {
      event.preventDefault();
      events.lost();
    };
    const restored = (): void => {
      this.#programs = new Programs(this.#gl);
      this.#textures = new Textures(this.#gl);
      this.#tables = new Map();
      events.restored();
    };
    this.#canvas.addEventListener("webglcontextlost", lost, { signal });
    this.#canvas.addEventListener("webglcontextrestored", restored, { signal });
  }
}
