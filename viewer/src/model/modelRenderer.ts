import { adoptStyles } from "../core/dom";
import { add, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { localFromUvd } from "../geo/axes";
import { cssPixelM, uvFromScreen } from "../geo/camera";
import type { Frame } from "../geo/frame";
import { UsageError, type CustomLayer, type Map3D, type FrameState } from "../map3d";
import { CompositePass } from "./composite";
import { depthRangeOf, screenRectCorner, threeLighting, screenRectOf, type ScreenRect } from "./projection";
import type { ThreeLight, ThreeNode, Three, ThreeCamera, ThreeHit, ThreeRenderer, ThreeTarget } from "./threeTypes";

/** A model on a map, as the renderer uses it. */
export interface SceneModel {
  /** Its root node in the scene. */
  readonly pivot: ThreeNode;
  /** True while it has a listener for clicks. */
  readonly listening: boolean;
  /** Places the model relative to an origin (world) and returns its local bounding boxes. */
  boxes(origin: Vec3): readonly Box3[];
  /** Advances its animations. @returns false when none plays */
  step(seconds: number): boolean;
  clicked(point: Vec2, position: Vec3, hit: ThreeHit): void;
  failed(error: Error): void;
}

const NEEDS_WEBGL = "a modelLayer needs WebGL, but this map draws on a 2D canvas; check map.drawer and show a marker instead";
const STYLES = ".map3d.map3d-over-model > canvas { cursor: pointer; }";
/** Samples per pixel; every WebGL2 implementation has at least four. */
const SAMPLES = 4;
/** Longest animation step, so that animations do not jump after a pause. */
const MAX_STEP_S = 0.25;
/** Hit tolerance of lines and points, CSS pixels. */
const TOLERANCE_PX = 4;

const renderers = new WeakMap<Map3D, Map<Three, ModelRenderer>>();

/**
 * Renders all models of a map with one three.js renderer and scene.
 *
 * three.js draws to its own framebuffer, not to the canvas, for three reasons: the canvas has no multisampling, so edges would be jagged; three.js changes GL
 * state, which the drawer needs unchanged within a frame; and during a transition the map does not draw to the canvas. Before each frame, three.js draws the
 * part of the screen that contains models, with four samples per pixel. The result is then composited with its depth: an orthographic camera whose near and
 * far planes are the frame's range of D has the same depth values as the images.
 */
export class ModelRenderer implements CustomLayer {
  readonly #map: Map3D;
  readonly #three: Three;
  readonly #renderer: ThreeRenderer;
  readonly #scene: ThreeNode;
  readonly #camera: ThreeCamera;
  readonly #sky: ThreeLight;
  readonly #sun: ThreeLight;
  readonly #models = new Map<ThreeNode, SceneModel>();
  #composite: CompositePass | undefined;
  #target: ThreeTarget | undefined;
  /** The rendered part of the screen; null when no model is in view. */
  #rect: ScreenRect | null = null;
  #last_ms: number | null = null;
  #contextLost = false;

  /** Adds a model to a map. @throws UsageError when the map does not draw with WebGL */
  static add(map: Map3D, three: Three, model: SceneModel): void {
    const gl = map.drawer === "webgl" ? map.canvas.getContext("webgl2") : null;
    if (!gl) throw new UsageError(NEEDS_WEBGL);
    const ofMap = renderers.get(map) ?? new Map<Three, ModelRenderer>();
    renderers.set(map, ofMap);
    const renderer = ofMap.get(three) ?? new ModelRenderer(map, three, gl);
    ofMap.set(three, renderer);
    renderer.#models.set(model.pivot, model);
    renderer.#scene.add(model.pivot);
  }

  /** Removes a model; with the last one, frees all GPU resources. */
  static remove(map: Map3D, three: Three, { pivot }: SceneModel): void {
    const renderer = renderers.get(map)?.get(three);
    if (!renderer || !renderer.#models.delete(pivot)) return;
    renderer.#scene.remove(pivot);
    if (renderer.#models.size > 0) return;
    renderers.get(map)?.delete(three);
    renderer.#dispose();
  }

  private constructor(map: Map3D, three: Three, gl: WebGL2RenderingContext) {
    this.#map = map;
    this.#three = three;
    this.#renderer = new three.WebGLRenderer({ canvas: map.canvas, context: gl });
    this.#renderer.setClearColor(0, 0);
    this.#renderer.resetState();
    [this.#scene, this.#camera, this.#sky, this.#sun] = [
      new three.Scene(),
      new three.OrthographicCamera(),
      new three.AmbientLight(),
      new three.DirectionalLight(),
    ];
    this.#camera.matrixAutoUpdate = false;
    this.#scene.add(this.#sky);
    this.#scene.add(this.#sun);
    adoptStyles(document, STYLES);
    map
      .toggleCustomLayer(this)
      .on("preclick", this.#onClick)
      .on("mousemove", this.#onMouseMove)
      .on("contextlost", this.#onContextLost)
      .on("contextrestored", this.#onContextRestored);
    map.frameEvents.on("draw", this.#onDraw);
  }

  #dispose(): void {
    const map = this.#map;
    map
      .toggleCustomLayer(this, false)
      .off("preclick", this.#onClick)
      .off("mousemove", this.#onMouseMove)
      .off("contextlost", this.#onContextLost)
      .off("contextrestored", this.#onContextRestored);
    map.frameEvents.off("draw", this.#onDraw);
    map.container.classList.remove("map3d-over-model");
    this.#composite?.free();
    this.#target?.dispose();
    this.#renderer.dispose();
    this.#renderer.resetState();
  }

  // CustomLayer

  getDepthRange(frame: Frame): Vec2 | null {
    return depthRangeOf(this.#boxes(), frame);
  }

  prerender(gl: WebGL2RenderingContext, state: FrameState, range: Vec2): void {
    this.#rect = screenRectOf(this.#boxes(), state);
    if (!this.#rect) return;
    this.#updateCamera(state, this.#rect, range);
    this.#updateLights(state);
    this.#composite ??= new CompositePass(gl);
    this.#target = this.#targetOf(this.#rect);
    this.#renderer.resetState();
    this.#renderer.setRenderTarget(this.#target);
    this.#renderer.render(this.#scene as never, this.#camera as never);
    this.#renderer.resetState();
  }

  render(_gl: WebGL2RenderingContext, state: FrameState, soft: boolean): void {
    const [rect, target] = [this.#rect, this.#target];
    if (!rect || !target?.depthTexture) return;
    const [color, depth] = [target.texture, target.depthTexture].map(
      (texture) => (this.#renderer.properties.get(texture) as { __webglTexture?: WebGLTexture }).__webglTexture,
    );
    if (color && depth) this.#composite?.draw(color, depth, rect, state, soft);
  }

  #boxes(): Box3[] {
    const origin = this.#map.getViewState()?.origin;
    return origin ? [...this.#models.values()].flatMap((model) => model.boxes(origin)) : [];
  }

  #targetOf({ width, height }: ScreenRect): ThreeTarget {
    if (this.#target?.width === width && this.#target.height === height) return this.#target;
    this.#target?.dispose();
    return new this.#three.WebGLRenderTarget(width, height, {
      samples: SAMPLES,
      colorSpace: "srgb",
      depthTexture: new this.#three.DepthTexture(width, height) as never,
    });
  }

  /** Places the camera at the centre of what it sees, which keeps coordinates on the GPU small. */
  #updateCamera(state: FrameState, rect: ScreenRect, [near, far]: Vec2): void {
    const { right, up, forward } = state.camera.frame.axes;
    const [left, top, px] = screenRectCorner(rect, state);
    const [w, h, d] = [rect.width * px, rect.height * px, (near + far) / 2];
    const [x, y, z] = localFromUvd(state.camera.frame.axes, [left + w / 2, top - h / 2, d]);
    Object.assign(this.#camera, {
      left: -w / 2,
      right: w / 2,
      top: h / 2,
      bottom: -h / 2,
      near: near - d,
      far: far - d,
      matrixWorldNeedsUpdate: true,
    });
    this.#camera.matrix.set(right[0], up[0], -forward[0], x, right[1], up[1], -forward[1], y, right[2], up[2], -forward[2], z, 0, 0, 0, 1);
    this.#camera.updateProjectionMatrix();
  }

  #updateLights({ light }: FrameState): void {
    const { sky_rgb, sky, sun_rgb, sun, towards } = threeLighting(light);
    this.#sky.color.setRGB(...sky_rgb);
    this.#sky.intensity = sky;
    this.#sun.color.setRGB(...sun_rgb);
    this.#sun.intensity = sun;
    this.#sun.position.set(...towards);
  }

  // Map events

  /** Advances animations with each frame and requests the next frame while one plays. */
  readonly #onDraw = (): void => {
    const now = performance.now();
    const seconds = Math.min((now - (this.#last_ms ?? now)) / 1000, MAX_STEP_S);
    const moving = [...this.#models.values()].filter((model) => model.step(seconds)).length > 0 && !this.#contextLost;
    this.#last_ms = moving ? now : null;
    if (moving) this.#map.layerContext?.requestFrame();
  };

  readonly #onContextLost = (): void => {
    this.#contextLost = true;
    this.#composite = undefined;
  };

  readonly #onContextRestored = (): void => {
    this.#contextLost = false;
    if (this.#map.drawer !== "webgl") for (const model of [...this.#models.values()]) model.failed(new UsageError(NEEDS_WEBGL));
  };

  readonly #onClick = ({ point }: { point: Vec2 }): void => {
    const found = this.#hitTest(point);
    found?.model.clicked(point, found.position, found.hit);
  };

  readonly #onMouseMove = ({ point }: { point: Vec2 }): unknown =>
    this.#map.container.classList.toggle("map3d-over-model", this.#hitTest(point) !== null);

  /** Returns the nearest model under a point of the screen if it has a click listener and, as far as depths are known, no image hides it. */
  #hitTest(point: Vec2): { model: SceneModel; position: Vec3; hit: ThreeHit } | null {
    const { visibleDepths, inTransition } = this.#map;
    if (!visibleDepths || inTransition || ![...this.#models.values()].some(({ listening }) => listening)) return null;
    const { camera, origin } = visibleDepths;
    const { axes } = camera.frame;
    const [near] = depthRangeOf(this.#boxes(), camera.frame) ?? [0];
    const [u, v] = uvFromScreen(camera, point);
    const ray = new this.#three.Raycaster();
    ray.camera = this.#camera;
    ray.params.Line.threshold = ray.params.Points.threshold = TOLERANCE_PX * cssPixelM(camera);
    ray.set(new this.#three.Vector3(...localFromUvd(axes, [u, v, near - 1])), new this.#three.Vector3(...axes.forward));
    const hit = ray.intersectObjects([...this.#models.keys()], true).find(({ object }) => isVisible(object));
    if (!hit) return null;
    const local: Vec3 = [hit.point.x, hit.point.y, hit.point.z];
    const model = this.#modelOf(hit.object);
    const d = axes.forward[0] * local[0] + axes.forward[1] * local[1] + axes.forward[2] * local[2];
    return model?.listening && !visibleDepths.isOccluded(u, v, d) ? { model, position: add(origin, local), hit } : null;
  }

  #modelOf(node: ThreeNode): SceneModel | undefined {
    let at: ThreeNode | null = node;
    while (at && !this.#models.has(at)) at = at.parent;
    return at ? this.#models.get(at) : undefined;
  }
}

function isVisible(node: ThreeNode): boolean {
  return node.visible && (!node.parent || isVisible(node.parent));
}
