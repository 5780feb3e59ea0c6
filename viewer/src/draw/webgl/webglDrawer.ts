import { DrawError } from "../../core/errors";
import type { Vec2, Vec3 } from "../../core/vec";
import { towardsLight } from "../../geo/light";
import type { LayerKind } from "../../tiles/tileData";
import {
  listBakedLightKinds,
  listRequiredKinds,
  type Drawer,
  type DrawerEvents,
  type FrameContent,
  type Mode,
  type LayerPass,
  type Quad,
} from "../drawer";
import { computeDepthAtZero, computeCustomLayerBias, joinDepthRanges, computeMaxStep, type DepthMapping } from "../depthMapping";
import { packColor, packStyle } from "../drawStyle";
import type { Program } from "../lightEstimator";
import { OffscreenTarget } from "./offscreenTarget";
import { Programs, textureUnit } from "./program";
import { IdTextures } from "./idTextures";
import { computeReadableBounds, TileTextures, type TileTexture } from "./textures";

const SAMPLERS = {
  color: "u_color",
  picture: "u_color",
  normal: "u_normal",
  id: "u_id",
  depth: "u_depth",
  depth2: "u_depth",
  sun: "u_shadow",
  sun16: "u_shadow",
  ao: "u_ao",
} as const;

/** The textures of a quad. */
interface QuadTextures {
  readonly quad: Quad;
  /** Required textures; undefined: not loaded. */
  readonly textures: readonly (readonly [LayerKind, TileTexture | undefined])[];
  /** Loaded textures of baked light. */
  readonly bakedLight: readonly (readonly [LayerKind, TileTexture])[];
  readonly ids: TileTexture | undefined;
  /** Depths for the light estimate, if used and loaded. */
  readonly depth: TileTexture | undefined;
}

export interface WebGLOptions {
  /** Keeps the picture readable after a frame, for tests and screenshots; costs memory. */
  preserve: boolean;
  /** Refuses software rendering, which takes nine times the CPU of the canvas drawer. */
  requireGpu: boolean;
}

/** Draws with WebGL2: one quad per tile; shades and highlights in the shader. */
export class WebGLDrawer implements Drawer {
  readonly name = "webgl";
  readonly busy = false;
  readonly showsPreviousView = false;
  readonly gl: WebGL2RenderingContext;
  readonly #canvas: HTMLCanvasElement;
  readonly #listeners = new AbortController();
  #programs: Programs;
  #textures: TileTextures;
  #idTextures: IdTextures;
  #offscreen: OffscreenTarget | undefined;

  /** @throws DrawError when the browser has no WebGL2, or none on a GPU where that is required */
  constructor(canvas: HTMLCanvasElement, options: WebGLOptions, events: DrawerEvents) {
    const settings: WebGLContextAttributes = {
      alpha: true,
      premultipliedAlpha: true,
      antialias: false,
      depth: false,
      stencil: false,
      preserveDrawingBuffer: options.preserve,
      failIfMajorPerformanceCaveat: options.requireGpu,
    };
    const gl = canvas.getContext("webgl2", settings);
    if (!gl) throw new DrawError("this browser does not support WebGL2; update it or enable hardware acceleration");
    if (options.requireGpu && isSoftware(gl)) {
      gl.getExtension("WEBGL_lose_context")?.loseContext();
      throw new DrawError("this browser draws WebGL2 without a GPU");
    }
    this.gl = gl;
    this.#canvas = canvas;
    this.#programs = new Programs(gl);
    this.#textures = new TileTextures(gl);
    this.#idTextures = new IdTextures(gl);
    this.#listen(events);
    if (gl.isContextLost()) restoreContext(canvas);
  }

  get element(): HTMLElement {
    return this.#canvas;
  }

  draw(frame: FrameContent): void {
    const gl = this.gl;
    if (gl.isContextLost()) return;
    gl.disable(gl.CULL_FACE);
    const join = (depths: readonly DepthMapping[]): Vec2 | null => joinDepthRanges(depths, listCustomLayerRanges(frame));
    const estimator = frame.lighting?.estimator;
    estimator?.update(
      gl,
      frame,
      () => join(frame.passes.flatMap(({ relief }) => relief ?? [])) as Vec2,
      (coarse, pass, range) => this.#drawPass(coarse, pass, range, false),
    );
    const combined = frame.passes.filter(({ depths }) => depths);
    const range = frame.target?.range ?? estimator?.range ?? join(combined.flatMap(({ depths }) => depths ?? []));
    const bias = Math.max(0, ...combined.map(({ depths, level }) => (depths ? computeCustomLayerBias(depths.frame, level) : 0)));
    if (range) for (const layer of frame.customLayers) layer.prerender(gl, frame, [range[0] + bias, range[1] + bias]);
    const offscreen = this.#getOffscreen(frame, combined.length + frame.customLayers.length > 0);
    this.#clear(frame, frame.target?.framebuffer ?? offscreen?.framebuffer ?? null);
    for (const pass of frame.passes) {
      if (!pass.depths) this.#drawPass(frame, pass, null, false);
      else if (pass === combined[0]) this.#drawCombined(frame, combined, range);
    }
    if (combined.length === 0) this.#drawCombined(frame, [], range);
    gl.disable(gl.SCISSOR_TEST);
    if (!frame.target) offscreen?.copyToCanvas();
    this.#idTextures.freeAllBut(
      new Set(frame.passes.flatMap(({ highlight, drawStyles }) => [highlight, ...(drawStyles ? [drawStyles.byId] : [])])),
    );
  }

  release(key: string): void {
    this.#textures.release(key);
  }

  destroy(): void {
    this.#listeners.abort();
    this.#textures.clear();
    this.#idTextures.freeAllBut(new Set());
    this.#offscreen?.free();
    loseContext(this.#canvas, this.gl);
  }

  /** Returns the target for a frame that needs depth; keeps it from frame to frame while it is needed. */
  #getOffscreen({ target, width, height }: FrameContent, needed: boolean): OffscreenTarget | undefined {
    if (target || (needed && this.#offscreen?.width === width && this.#offscreen.height === height)) return this.#offscreen;
    this.#offscreen?.free();
    return (this.#offscreen = needed ? new OffscreenTarget(this.gl, width, height) : undefined);
  }

  #clear({ width, height }: FrameContent, framebuffer: WebGLFramebuffer | null): void {
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

  /** Draws passes and custom layers that hide each other by depth: first all opaque pixels, then edges and translucent passes. */
  #drawCombined(frame: FrameContent, passes: readonly LayerPass[], range: Vec2 | null): void {
    const gl = this.gl;
    if (!range) return;
    gl.enable(gl.DEPTH_TEST);
    for (const pass of passes) if (pass.opacity === 1) this.#drawPass(frame, pass, range, false);
    this.#drawCustomLayers(frame, false);
    gl.depthMask(frame.target !== undefined);
    for (const pass of passes) this.#drawPass(frame, pass, range, true);
    this.#drawCustomLayers(frame, true);
    gl.disable(gl.DEPTH_TEST);
  }

  #drawCustomLayers(frame: FrameContent, soft: boolean): void {
    this.gl.disable(this.gl.SCISSOR_TEST);
    for (const layer of frame.customLayers) layer.render(this.gl, frame, soft);
  }

  /** @param range minimum and maximum D of the combined passes; null: not combined  @param soft draws only edges and translucent passes */
  #drawPass(frame: FrameContent, pass: LayerPass, range: Vec2 | null, soft: boolean): void {
    const gl = this.gl;
    this.#setScissor(frame, pass);
    const mode: Mode = pass.mode === "lit" && !frame.light.lit ? "color" : pass.mode;
    const estimator = mode === "lit" && frame.lighting?.estimator.appliesTo(frame, pass) ? frame.lighting.estimator : null;
    // Uploads all before drawing the first, so that gutters have their neighbours' pixels.
    for (const ready of pass.quads.map((quad) => this.#collectTextures(pass, mode, quad, estimator !== null))) {
      const { quad, textures, bakedLight, ids, depth } = ready;
      if (textures.some(([, texture]) => !texture)) continue;
      const has = (kind: LayerKind): boolean => bakedLight.some(([other]) => other === kind);
      const shadow = has("sun") ? "sun" : has("sun16") ? "sun16" : null;
      const styled = ids !== undefined && pass.drawStyles !== null;
      const program = this.#programs.use({
        mode,
        masked: pass.masked,
        highlight: ids !== undefined && pass.highlight.size > 0,
        styled,
        shadow,
        occlusion: has("ao"),
        combined: range !== null,
        estimate: (depth && estimator?.shader) ?? "",
      });
      for (const [kind, texture] of [...textures, ...bakedLight]) this.#bind(kind, texture);
      if (depth && pass.relief && estimator?.range) {
        this.#bind("depth", depth);
        this.#setDepths(program, pass.relief, quad, estimator.range, false);
        estimator.bind(gl, program, frame, pass);
      }
      if (range && pass.depths) this.#setDepths(program, pass.depths, quad, range, soft);
      if (ids) this.#bindIds(program, pass, quad, ids, frame.dpr);
      this.#drawQuad(
        frame,
        pass,
        quad,
        program,
        [...textures, ...bakedLight, ["id", ids] as const, ["depth", depth] as const].flatMap(([, texture]) => texture ?? []),
      );
    }
  }

  #collectTextures(pass: LayerPass, mode: Mode, quad: Quad, shaded: boolean): QuadTextures {
    return {
      quad,
      textures: listRequiredKinds(mode, pass.masked, pass.depths !== null).map(
        (kind) => [kind, this.#getTexture(pass, kind, quad)] as const,
      ),
      bakedLight: listBakedLightKinds(mode, pass.bakedLight).flatMap((kind) => {
        const texture = this.#getTexture(pass, kind, quad);
        return texture ? [[kind, texture] as const] : [];
      }),
      depth: shaded ? this.#getTexture(pass, "depth", quad) : undefined,
      ids: pass.highlight.size > 0 || pass.drawStyles ? this.#getTexture(pass, "id", quad) : undefined,
    };
  }

  #getTexture(pass: LayerPass, kind: LayerKind, { from }: Quad): TileTexture | undefined {
    const key = pass.tiles.key(kind, from);
    const known = this.#textures.get(key);
    if (known) return known;
    const data = pass.tiles.data(kind, from);
    if (!data) return undefined;
    const neighbour = (dx: number, dy: number): string => pass.tiles.key(kind, { z: from.z, x: from.x + dx, y: from.y + dy });
    const texture = this.#textures.upload(key, data, neighbour);
    pass.tiles.onUploaded(kind, from);
    return texture;
  }

  #bind(kind: LayerKind, texture: TileTexture | undefined): void {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + textureUnit(SAMPLERS[kind]));
    gl.bindTexture(gl.TEXTURE_2D, texture?.texture ?? null);
  }

  #drawQuad(frame: FrameContent, pass: LayerPass, quad: Quad, program: Program, textures: readonly TileTexture[]): void {
    const gl = this.gl;
    const { width, height, light } = frame;
    const [left, top, right, bottom] = quad.rect;
    const [x, y] = [(at: number): number => (at / width) * 2 - 1, (at: number): number => 1 - (at / height) * 2];
    gl.uniform4f(program.at("u_rect"), x(left), y(top), x(right), y(bottom));
    gl.uniform1f(program.at("u_height"), height);
    gl.uniform2f(program.at("u_origin"), ...quad.origin);
    gl.uniform1f(program.at("u_scale"), quad.scale);
    gl.uniform1i(program.at("u_size"), textures[0]?.width ?? 0);
    gl.uniform4i(program.at("u_bounds"), ...computeReadableBounds(textures));
    gl.uniform1f(program.at("u_opacity"), pass.opacity);
    gl.uniform3f(program.at("u_sun"), ...towardsLight(light));
    gl.uniform3f(program.at("u_sky"), ...scaled(light.sky_rgb, light.ambient));
    gl.uniform3f(program.at("u_beam"), ...scaled(light.sun_rgb, light.diffuse));
    gl.uniform2ui(program.at("u_suns"), pass.bakedLight.shadow?.first ?? 0, pass.bakedLight.shadow?.second ?? 0);
    gl.uniform1f(program.at("u_share"), pass.bakedLight.shadow?.share ?? 0);
    gl.uniform2f(program.at("u_range"), ...pass.depthRange);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  #setDepths(program: Program, depths: DepthMapping, { from }: Quad, [near, far]: Vec2, soft: boolean): void {
    this.gl.uniform2f(program.at("u_depths"), (computeDepthAtZero(depths) - near) / (far - near), depths.unit_m / (far - near));
    this.gl.uniform1ui(program.at("u_maxStep"), computeMaxStep(depths, from.z));
    this.gl.uniform1i(program.at("u_soft"), Number(soft));
  }

  #setScissor({ width, height }: FrameContent, { clip }: LayerPass): void {
    const gl = this.gl;
    if (!clip) {
      gl.disable(gl.SCISSOR_TEST);
      return;
    }
    const [left, top, right, bottom] = [
      Math.round(clip[0] * width),
      Math.round(clip[1] * height),
      Math.round(clip[2] * width),
      Math.round(clip[3] * height),
    ];
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(left, height - bottom, Math.max(0, right - left), Math.max(0, bottom - top));
  }

  #bindIds(program: Program, { highlight, drawStyles }: LayerPass, quad: Quad, ids: TileTexture, dpr: number): void {
    const gl = this.gl;
    this.#bind("id", ids);
    gl.uniform1f(program.at("u_rim"), Math.max(1, 1.25 * dpr * quad.scale));
    if (highlight.size > 0) this.#idTextures.bind(program, ["u_table", "u_mask", "u_probes"], highlight, packColor);
    if (!drawStyles) return;
    this.#idTextures.bind(program, ["u_styles", "u_styleMask", "u_styleProbes"], drawStyles.byId, packStyle);
    gl.uniform1ui(program.at("u_others"), packStyle(drawStyles.others));
  }

  #listen(events: DrawerEvents): void {
    const { signal } = this.#listeners;
    const lost = (event: Event): void => {
      event.preventDefault();
      events.lost();
    };
    const restored = (): void => {
      this.#programs = new Programs(this.gl);
      this.#textures = new TileTextures(this.gl);
      this.#idTextures = new IdTextures(this.gl);
      this.#offscreen = undefined;
      events.restored();
    };
    this.#canvas.addEventListener("webglcontextlost", lost, { signal });
    this.#canvas.addEventListener("webglcontextrestored", restored, { signal });
  }
}

/** What restores the contexts that maps have given back; a lost context no longer has it. */
const restorers = new WeakMap<HTMLCanvasElement, WEBGL_lose_context>();

/** Gives a context back at once: browsers have few, and take them from others on the page. */
function loseContext(canvas: HTMLCanvasElement, gl: WebGL2RenderingContext): void {
  const context = gl.getExtension("WEBGL_lose_context");
  if (!context) return;
  // Without this, the next map on the canvas could not restore it.
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault(), { once: true });
  restorers.set(canvas, context);
  context.loseContext();
}

/** Restores the context of a canvas that had a map before, once the browser has told its loss. */
function restoreContext(canvas: HTMLCanvasElement): void {
  const context = restorers.get(canvas);
  setTimeout(() => context?.restoreContext());
}

/** Whether WebGL runs on the CPU. Browsers report it by the flag above if they chose so themselves, and by the renderer's name otherwise. */
function isSoftware(gl: WebGL2RenderingContext): boolean {
  const renderer = String(gl.getParameter(gl.RENDERER));
  // WebKit hides the name behind this extension.
  const debugInfo = renderer === "WebKit WebGL" ? gl.getExtension("WEBGL_debug_renderer_info") : null;
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(
    debugInfo ? String(gl.getParameter(debugInfo.UNMASKED_RENDERER_WEBGL)) : renderer,
  );
}

/** Lists the ranges of D of a frame's custom layers. */
const listCustomLayerRanges = ({ customLayers, camera }: FrameContent): Vec2[] =>
  customLayers.flatMap((layer) => {
    const range = layer.getDepthRange(camera.frame);
    return range ? [range] : [];
  });

const scaled = ([x, y, z]: Vec3, by: number): Vec3 => [x * by, y * by, z * by];
