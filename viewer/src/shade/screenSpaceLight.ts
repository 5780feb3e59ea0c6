import { dot, type Vec2, type Vec3 } from "../core/vec";
import { cssPixelM, type Camera } from "../geo/camera";
import { towardsLight } from "../geo/light";
import type { Addable, DrawDepths, FrameContent, LayerPass, LightEstimator, Program } from "../map3d";
import type { DepthLightEstimator } from "./depthLightEstimator";
import { DepthTarget } from "./depthTarget";
import { READ } from "./shaders";

/** The texture unit of the estimate, beyond those of the drawer. */
const UNIT = 8;

/** The light estimated for a frame. */
interface EstimatedLight {
  readonly texture: WebGLTexture;
  readonly range: Vec2;
  /** The frame's camera, device pixels per pixel of the estimate, and its pixels per CSS pixel. */
  readonly camera: Camera;
  readonly step: number;
  readonly scale: number;
  readonly height: number;
  /** Fraction of the range that counts as the same depth. */
  readonly tolerance: number;
}

/** Computes screen-space shadows and ambient occlusion of a map and binds them for the drawer's shader. */
export class ScreenSpaceLight implements LightEstimator {
  readonly shader = READ;
  readonly copy: () => Addable<never>;
  held = false;
  readonly #estimator: DepthLightEstimator;
  #depthTarget: DepthTarget | undefined;
  #result: EstimatedLight | null = null;

  constructor(estimator: DepthLightEstimator, copy: () => Addable<never>) {
    this.#estimator = estimator;
    this.copy = copy;
  }

  get range(): Vec2 | null {
    return this.#result?.range ?? null;
  }

  update(gl: WebGL2RenderingContext, frame: FrameContent, getRange: () => Vec2, draw: DrawDepths): void {
    if (this.held) return;
    const { lighting, camera } = frame;
    const step = Math.max(1, frame.dpr);
    const last = this.#result;
    if (!frame.passes.some((pass) => needsEstimate(frame, pass))) this.#result = null;
    else if (!lighting?.moving || frame.target || last?.camera.frame !== camera.frame || last.step !== step)
      this.#result = this.#estimate(gl, frame, step, frame.target?.range ?? getRange(), draw);
  }

  /** Whether a pass uses the estimate. */
  appliesTo(frame: FrameContent, pass: LayerPass): boolean {
    return this.#result !== null && needsEstimate(frame, pass);
  }

  /** Frees its GPU resources. */
  free(): void {
    this.#estimator.free();
    this.#depthTarget?.free();
    this.#depthTarget = undefined;
    this.#result = null;
  }

  bind(gl: WebGL2RenderingContext, program: Program, frame: FrameContent, { bakedLight }: LayerPass): void {
    if (!this.#result) return;
    const { texture, camera, scale, height, tolerance } = this.#result;
    gl.uniform1i(program.at("u_estimate"), UNIT);
    gl.activeTexture(gl.TEXTURE0 + UNIT);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    const now = frame.camera;
    const px = cssPixelM(camera);
    const zoomRatio = cssPixelM(now) / px;
    const [x, y] = [
      (now.u - camera.u) / px + camera.width / 2 - (zoomRatio * now.width) / 2,
      (camera.v - now.v) / px + camera.height / 2 - (zoomRatio * now.height) / 2,
    ];
    gl.uniform4f(program.at("u_estimateMap"), (zoomRatio * scale) / frame.dpr, x * scale, y * scale, height);
    gl.uniform1f(program.at("u_tolerance"), tolerance);
    gl.uniform2i(
      program.at("u_estimated"),
      Number(frame.light.occlusion && !bakedLight.occlusion),
      Number(hasShadows(frame) && !bakedLight.shadow),
    );
  }

  #estimate(gl: WebGL2RenderingContext, frame: FrameContent, step: number, range: Vec2, draw: DrawDepths): EstimatedLight {
    const { light, camera } = frame;
    const [width, height] = [Math.ceil(frame.width / step), Math.ceil(frame.height / step)];
    const px_m = (cssPixelM(camera) * step) / frame.dpr;
    const picture = this.#getDepthTarget(gl, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, picture.framebuffer);
    gl.viewport(0, 0, width, height);
    gl.depthMask(true);
    gl.disable(gl.SCISSOR_TEST);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    for (const pass of frame.passes)
      if (pass.relief && pass.opacity === 1) draw({ ...frame, width, height }, makeDepthPass(pass, step), range);
    const { right, up, forward } = camera.frame.axes;
    const towards = towardsLight(light);
    const sun: Vec3 | null = hasShadows(frame) ? [dot(right, towards), dot(up, towards), dot(forward, towards)] : null;
    const texture = this.#estimator.estimateLight({
      gl,
      depth: picture.texture,
      width,
      height,
      px_m,
      range,
      sun,
      occlusion: light.occlusion,
    });
    gl.disable(gl.DEPTH_TEST);
    return { texture, range, camera, step, scale: frame.dpr / step, height, tolerance: (2 * px_m) / (range[1] - range[0]) + 1 / 65535 };
  }

  #getDepthTarget(gl: WebGL2RenderingContext, width: number, height: number): DepthTarget {
    const target = this.#depthTarget;
    if (target?.width === width && target.height === height) return target;
    target?.free();
    return (this.#depthTarget = new DepthTarget(gl, width, height));
  }
}

const hasShadows = ({ light }: FrameContent): boolean => light.shadows && light.elevation_deg > 0;

/** Whether a pass lacks rendered light that can be estimated. */
function needsEstimate(frame: FrameContent, { mode, relief, bakedLight }: LayerPass): boolean {
  const { light } = frame;
  return (
    relief !== null &&
    mode === "lit" &&
    light.lit &&
    ((light.occlusion && !bakedLight.occlusion) || (hasShadows(frame) && !bakedLight.shadow))
  );
}

/** Makes a pass that draws depths only, with pixels `step` times as large. */
function makeDepthPass(pass: LayerPass, step: number): LayerPass {
  const quads = pass.quads.map(({ from, rect: [left, top, right, bottom], origin: [x, y], scale }) => ({
    from,
    rect: [left / step, top / step, right / step, bottom / step] as const,
    origin: [x / step, y / step] as const,
    scale: scale * step,
  }));
  return { ...pass, mode: "depth", quads, highlight: new Map(), depths: pass.relief };
}
