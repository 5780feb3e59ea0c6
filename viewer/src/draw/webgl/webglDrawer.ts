import { DrawError } from "../../core/errors";
import type { Vec2, Vec3 } from "../../core/vec";
import { towardsLight } from "../../geo/light";
import type { LayerKind } from "../../geo/manifest";
import { bakedKinds, neededKinds, type Drawer, type DrawerEvents, type FrameSpec, type Mode, type Pass, type Quad } from "../drawer";
import { firstOf, guestLead, rangeOf, steepOf, type Depths } from "../combine";
import { packColor, packFinish } from "../drawStyle";
import { DeepCanvas } from "./deepCanvas";
import { FoundLight, guestRanges } from "./foundLight";
import { Programs, unitOf, type Program } from "./program";
import { Tables } from "./tables";
import { boundsOf, Textures, type TileTexture } from "./textures";

const SAMPLERS = {
  color: "u_color", picture: "u_color", normal: "u_normal", id: "u_id", depth: "u_depth", depth2: "u_depth", sun: "u_shadow", sun16: "u_shadow", ao: "u_ao",
} as const;

/** What is drawn of a quad. */
interface Ready {
  readonly quad: Quad;
  /** Those without which nothing is drawn; absent: not here. */
  readonly textures: readonly (readonly [LayerKind, TileTexture | undefined])[];
  /** Baked light that is here. */
  readonly baked: readonly (readonly [LayerKind, TileTexture])[];
  readonly ids: TileTexture | undefined;
  /** Where the pass is shaded, and depths are here. */
  readonly depth: TileTexture | undefined;
}

export interface WebGLOptions {
  /** Keep the picture readable after a frame: for tests and screenshots; costs memory. */
  preserve: boolean;
  /** Not where the processor would do the work of the GPU, which a canvas without WebGL does with a ninth of it. */
  quick: boolean;
}

/** Draws with WebGL2: one quad a tile, light and highlights in the shader. */
export class WebGLDrawer implements Drawer {
  readonly name = "webgl";
  readonly busy = false;
  readonly note = "";
  readonly gl: WebGL2RenderingContext;
  readonly #canvas: HTMLCanvasElement;
  readonly #listeners = new AbortController();
  #programs: Programs;
  #textures: Textures;
  #tables: Tables;
  #found: FoundLight;
  #deep: DeepCanvas | undefined;

  /** @throws DrawError when the browser has no WebGL2, or none that is quick */
  constructor(canvas: HTMLCanvasElement, options: WebGLOptions, events: DrawerEvents) {
    const settings: WebGLContextAttributes = { alpha: true, premultipliedAlpha: true, antialias: false, depth: false, stencil: false, preserveDrawingBuffer: options.preserve, failIfMajorPerformanceCaveat: options.quick };
    const gl = canvas.getContext("webgl2", settings);
    if (!gl) throw new DrawError("this browser offers no WebGL2, which the map needs to draw; update it or switch hardware acceleration on");
    if (options.quick && isSoftware(gl)) {
      gl.getExtension("WEBGL_lose_context")?.loseContext();
      throw new DrawError("this browser draws WebGL2 without a GPU");
    }
    this.gl = gl;
    this.#canvas = canvas;
    this.#programs = new Programs(gl);
    this.#textures = new Textures(gl);
    this.#tables = new Tables(gl);
    this.#found = new FoundLight(gl);
    this.#watch(events);
  }

  get element(): HTMLElement {
    return this.#canvas;
  }

  draw(frame: FrameSpec): void {
    const gl = this.gl;
    if (gl.isContextLost()) return;
    gl.disable(gl.CULL_FACE);
    this.#found.find(frame, (coarse, pass, range) => { this.#drawPass(coarse, pass, range, false); });
    const combined = frame.passes.filter(({ depths }) => depths);
    const range = frame.into?.range ?? this.#found.range ?? rangeOf(combined.flatMap(({ depths }) => depths ?? []), guestRanges(frame));
    const lead = Math.max(0, ...combined.map(({ depths, level }) => (depths ? guestLead(depths.frame, level) : 0)));
    if (range) for (const guest of frame.customLayers) guest.prerender(gl, frame, [range[0] + lead, range[1] + lead]);
    const deep = this.#deepFor(frame, combined.length + frame.customLayers.length > 0);
    this.#begin(frame, frame.into?.framebuffer ?? deep?.framebuffer ?? null);
    for (const pass of frame.passes) {
      if (!pass.depths) this.#drawPass(frame, pass, null, false);
      else if (pass === combined[0]) this.#drawTogether(frame, combined, range);
    }
    if (combined.length === 0) this.#drawTogether(frame, [], range);
    gl.disable(gl.SCISSOR_TEST);
    if (!frame.into) deep?.show();
    this.#tables.keep(new Set(frame.passes.flatMap(({ highlight, finishes }) => [highlight, ...(finishes ? [finishes.byId] : [])])));
  }

  release(key: string): void {
    this.#textures.release(key);
  }

  destroy(): void {
    this.#listeners.abort();
    this.#textures.clear();
    this.#tables.keep(new Set());
    this.#found.free();
    this.#deep?.free();
  }

  /** What the frame is drawn in when it needs depth; kept from frame to frame as long as they do. */
  #deepFor({ into, width, height }: FrameSpec, needed: boolean): DeepCanvas | undefined {
    if (into || (needed && this.#deep?.width === width && this.#deep.height === height)) return this.#deep;
    this.#deep?.free();
    return (this.#deep = needed ? new DeepCanvas(this.gl, width, height) : undefined);
  }

  #begin({ width, height }: FrameSpec, framebuffer: WebGLFramebuffer | null): void {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthFunc(gl.LEQUAL);
  }

  /** Passes and guests that hide each other by depth: all that is solid, then edges and what lets through. */
  #drawTogether(frame: FrameSpec, passes: readonly Pass[], range: Vec2 | null): void {
    const gl = this.gl;
    if (!range) return;
    gl.enable(gl.DEPTH_TEST);
    for (const pass of passes) if (pass.opacity === 1) this.#drawPass(frame, pass, range, false);
    this.#drawGuests(frame, false);
    gl.depthMask(frame.into !== undefined);
    for (const pass of passes) this.#drawPass(frame, pass, range, true);
    this.#drawGuests(frame, true);
    gl.disable(gl.DEPTH_TEST);
  }

  #drawGuests(frame: FrameSpec, soft: boolean): void {
    this.gl.disable(this.gl.SCISSOR_TEST);
    for (const guest of frame.customLayers) guest.render(this.gl, frame, soft);
  }

  /** @param range of D, of what is drawn together  @param soft only what lets through */
  #drawPass(frame: FrameSpec, pass: Pass, range: Vec2 | null, soft: boolean): void {
    this.#clip(frame, pass);
    const mode: Mode = pass.mode === "lit" && !frame.light.lit ? "color" : pass.mode;
    const shaded = mode === "lit" && this.#found.lights(frame, pass);
    // All are uploaded before the first is drawn, so that gutters have their neighbours' pixels.
    for (const ready of pass.quads.map((quad) => this.#readyOf(pass, mode, quad, shaded))) {
      const { quad, textures, baked, ids, depth } = ready;
      if (textures.some(([, texture]) => !texture)) continue;
      const has = (kind: LayerKind): boolean => baked.some(([other]) => other === kind);
      const shadow = has("sun") ? "sun" : has("sun16") ? "sun16" : null;
      const finish = ids !== undefined && pass.finishes !== null;
      const program = this.#programs.use({ mode, masked: pass.masked, highlight: ids !== undefined && pass.highlight.size > 0, finish, shadow, occlusion: has("ao"), combined: range !== null, shaded: depth !== undefined });
      for (const [kind, texture] of [...textures, ...baked]) this.#bind(kind, texture);
      if (depth && pass.relief && this.#found.range) {
        this.#bind("depth", depth);
        this.#setDepths(program, pass.relief, quad, this.#found.range, false);
        this.#found.bind(program, frame, pass);
      }
      if (range && pass.depths) this.#setDepths(program, pass.depths, quad, range, soft);
      if (ids) this.#bindIds(program, pass, quad, ids, frame.dpr);
      this.#drawQuad(frame, pass, quad, program, [...textures, ...baked, ["id", ids] as const, ["depth", depth] as const].flatMap(([, texture]) => texture ?? []));
    }
  }

  #readyOf(pass: Pass, mode: Mode, quad: Quad, shaded: boolean): Ready {
    return {
      quad,
      textures: neededKinds(mode, pass.masked, pass.depths !== null).map((kind) => [kind, this.#textureOf(pass, kind, quad)] as const),
      baked: bakedKinds(mode, pass.baked).flatMap((kind) => {
        const texture = this.#textureOf(pass, kind, quad);
        return texture ? [[kind, texture] as const] : [];
      }),
      depth: shaded ? this.#textureOf(pass, "depth", quad) : undefined,
      ids: pass.highlight.size > 0 || pass.finishes ? this.#textureOf(pass, "id", quad) : undefined,
    };
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
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + unitOf(SAMPLERS[kind]));
    gl.bindTexture(gl.TEXTURE_2D, texture?.texture ?? null);
  }

  #drawQuad(frame: FrameSpec, pass: Pass, quad: Quad, program: Program, textures: readonly TileTexture[]): void {
    const gl = this.gl;
    const { width, height, light } = frame;
    const [left, top, right, bottom] = quad.rect;
    const [x, y] = [(at: number): number => (at / width) * 2 - 1, (at: number): number => 1 - (at / height) * 2];
    gl.uniform4f(program.at("u_rect"), x(left), y(top), x(right), y(bottom));
    gl.uniform1f(program.at("u_height"), height);
    gl.uniform2f(program.at("u_origin"), ...quad.origin);
    gl.uniform1f(program.at("u_scale"), quad.scale);
    gl.uniform1i(program.at("u_size"), textures[0]?.width ?? 0);
    gl.uniform4i(program.at("u_bounds"), ...boundsOf(textures));
    gl.uniform1f(program.at("u_opacity"), pass.opacity);
    gl.uniform3f(program.at("u_sun"), ...towardsLight(light));
    gl.uniform3f(program.at("u_sky"), ...scaled(light.sky_rgb, light.ambient));
    gl.uniform3f(program.at("u_beam"), ...scaled(light.sun_rgb, light.diffuse));
    gl.uniform2ui(program.at("u_suns"), pass.baked.shadow?.first ?? 0, pass.baked.shadow?.second ?? 0);
    gl.uniform1f(program.at("u_share"), pass.baked.shadow?.share ?? 0);
    gl.uniform2f(program.at("u_range"), ...pass.depthRange);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  #setDepths(program: Program, depths: Depths, { from }: Quad, [near, far]: Vec2, soft: boolean): void {
    this.gl.uniform2f(program.at("u_depths"), (firstOf(depths) - near) / (far - near), depths.unit_m / (far - near));
    this.gl.uniform1ui(program.at("u_steep"), steepOf(depths, from.z));
    this.gl.uniform1i(program.at("u_soft"), Number(soft));
  }

  #clip({ width, height }: FrameSpec, { clip }: Pass): void {
    const gl = this.gl;
    if (!clip) {
      gl.disable(gl.SCISSOR_TEST);
      return;
    }
    const [left, top, right, bottom] = [Math.round(clip[0] * width), Math.round(clip[1] * height), Math.round(clip[2] * width), Math.round(clip[3] * height)];
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(left, height - bottom, Math.max(0, right - left), Math.max(0, bottom - top));
  }

  #bindIds(program: Program, { highlight, finishes }: Pass, quad: Quad, ids: TileTexture, dpr: number): void {
    const gl = this.gl;
    this.#bind("id", ids);
    gl.uniform1f(program.at("u_rim"), Math.max(1, 1.25 * dpr * quad.scale));
    if (highlight.size > 0) this.#tables.bind(program, ["u_table", "u_mask", "u_probes", "u_one"], highlight, packColor);
    if (!finishes) return;
    this.#tables.bind(program, ["u_finishes", "u_finishMask", "u_finishProbes", "u_finishOne"], finishes.byId, packFinish);
    gl.uniform1ui(program.at("u_others"), packFinish(finishes.others));
  }

  #watch(events: DrawerEvents): void {
    const { signal } = this.#listeners;
    const lost = (event: Event): void => {
      event.preventDefault();
      events.lost();
    };
    const restored = (): void => {
      this.#programs = new Programs(this.gl);
      this.#textures = new Textures(this.gl);
      this.#tables = new Tables(this.gl);
      this.#found = new FoundLight(this.gl);
      this.#deep = undefined;
      events.restored();
    };
    this.#canvas.addEventListener("webglcontextlost", lost, { signal });
    this.#canvas.addEventListener("webglcontextrestored", restored, { signal });
  }
}

/** Does the processor do the work of the GPU? Browsers tell by the flag above when that is their own choice, and by name otherwise. */
function isSoftware(gl: WebGL2RenderingContext): boolean {
  const open = String(gl.getParameter(gl.RENDERER));
  // Some keep the name for those who ask twice.
  const told = open === "WebKit WebGL" ? gl.getExtension("WEBGL_debug_renderer_info") : null;
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(told ? String(gl.getParameter(told.UNMASKED_RENDERER_WEBGL)) : open);
}

const scaled = ([x, y, z]: Vec3, by: number): Vec3 => [x * by, y * by, z * by];
