import { adoptStyles } from "../core/dom";
import { add, type Box3, type Vec2, type Vec3 } from "../core/vec";
import { localFromUvd } from "../geo/axes";
import { cssPixelM, uvFromScreen } from "../geo/camera";
import type { Frame } from "../geo/frame";
import { UsageError, type CustomLayer, type map, type FrameState } from "../map3d";
import { Composite } from "./composite";
import { depthsOf, groundOf, lampsOf, partOf, type Part } from "./place";
import type { Lamp, ThreeNode, Three, ThreeCamera, ThreeHit, ThreeRenderer, ThreeTarget } from "./three";

/** One of the models of a map. */
export interface Member {
  /** What of it stands in the scene. */
  readonly pivot: ThreeNode;
  /** Somebody wants to know of clicks. */
  readonly listening: boolean;
  /** Local boxes of what it shows, its place being told from an origin (world). */
  boxes(origin: Vec3): readonly Box3[];
  /** Lets time pass. @returns false when nothing moves */
  step(seconds: number): boolean;
  clicked(point: Vec2, position: Vec3, hit: ThreeHit): void;
  failed(error: Error): void;
}

const NO_CANVAS = "a modelLayer needs WebGL, and this map draws on a 2D canvas (map.drawer tells): show a marker there, or nothing";
const STYLES = ".map3d.map3d-over-model > canvas { cursor: pointer; }";
/** Of a pixel: as many as every WebGL2 has. */
const SAMPLES = 4;
/** What has slept does not jump. */
const LONGEST_STEP_S = 0.25;
/** Lines and points are hit this far beside them. */
const NEAR_PX = 4;

const known = new WeakMap<map, Map<Three, Models>>();

/**
 * All models of a map: they share a renderer, a scene and a picture.
 *
 * The picture has a framebuffer of its own. Drawn onto the canvas, models would have jagged edges among images that have none; three.js would have to leave the
 * drawer's state as it was in the midst of a frame; and while the map turns it is not the canvas that is drawn on. So three.js draws with four samples a
 * pixel that part of the screen where models are, before the frame begins, and the picture is put among the images with its depth: three.js's orthographic camera
 * with the frame's range of D as its near and far planes has just the images' depth.
 */
export class Models implements CustomLayer {
  readonly #map: map;
  readonly #three: Three;
  readonly #renderer: ThreeRenderer;
  readonly #scene: ThreeNode;
  readonly #camera: ThreeCamera;
  readonly #sky: Lamp;
  readonly #sun: Lamp;
  readonly #members = new Map<ThreeNode, Member>();
  #composite: Composite | undefined;
  #target: ThreeTarget | undefined;
  /** Of the screen, that the picture shows; null: there is nothing to show. */
  #part: Part | null = null;
  #last_ms: number | null = null;
  #lost = false;

  /** Puts a model on a map. @throws UsageError when the map has no WebGL */
  static add(map: map, three: Three, member: Member): void {
    const gl = map.drawer === "webgl" ? map.canvas.getContext("webgl2") : null;
    if (!gl) throw new UsageError(NO_CANVAS);
    const here = known.get(map) ?? new Map<Three, Models>();
    known.set(map, here);
    const models = here.get(three) ?? new Models(map, three, gl);
    here.set(three, models);
    models.#members.set(member.pivot, member);
    models.#scene.add(member.pivot);
  }

  /** Takes it off; with the last one goes all that was made of the context. */
  static remove(map: map, three: Three, { pivot }: Member): void {
    const models = known.get(map)?.get(three);
    if (!models || !models.#members.delete(pivot)) return;
    models.#scene.remove(pivot);
    if (models.#members.size > 0) return;
    known.get(map)?.delete(three);
    models.#end();
  }

  private constructor(map: map, three: Three, gl: WebGL2RenderingContext) {
    this.#map = map;
    this.#three = three;
    this.#renderer = new three.WebGLRenderer({ canvas: map.canvas, context: gl });
    this.#renderer.setClearColor(0, 0);
    this.#renderer.resetState();
    [this.#scene, this.#camera, this.#sky, this.#sun] = [new three.Scene(), new three.OrthographicCamera(), new three.AmbientLight(), new three.DirectionalLight()];
    this.#camera.matrixAutoUpdate = false;
    this.#scene.add(this.#sky);
    this.#scene.add(this.#sun);
    adoptStyles(document, STYLES);
    map.toggleCustomLayer(this).on("preclick", this.#clicked).on("mousemove", this.#moved).on("contextlost", this.#gone).on("contextrestored", this.#back);
    map.frameEvents.on("draw", this.#drawn);
  }

  #end(): void {
    const map = this.#map;
    map.toggleCustomLayer(this, false).off("preclick", this.#clicked).off("mousemove", this.#moved).off("contextlost", this.#gone).off("contextrestored", this.#back);
    map.frameEvents.off("draw", this.#drawn);
    map.container.classList.remove("map3d-over-model");
    this.#composite?.free();
    this.#target?.dispose();
    this.#renderer.dispose();
    this.#renderer.resetState();
  }

  // What the drawer calls

  getDepthRange(frame: Frame): Vec2 | null {
    return depthsOf(this.#boxes(), frame);
  }

  prerender(gl: WebGL2RenderingContext, setting: FrameState, range: Vec2): void {
    this.#part = partOf(this.#boxes(), setting);
    if (!this.#part) return;
    this.#aim(setting, this.#part, range);
    this.#shine(setting);
    this.#composite ??= new Composite(gl);
    this.#target = this.#targetOf(this.#part);
    this.#renderer.resetState();
    this.#renderer.setRenderTarget(this.#target);
    this.#renderer.render(this.#scene as never, this.#camera as never);
    this.#renderer.resetState();
  }

  render(_gl: WebGL2RenderingContext, setting: FrameState, soft: boolean): void {
    const [part, target] = [this.#part, this.#target];
    if (!part || !target?.depthTexture) return;
    const [color, depth] = [target.texture, target.depthTexture].map((texture) => (this.#renderer.properties.get(texture) as { __webglTexture?: WebGLTexture }).__webglTexture);
    if (color && depth) this.#composite?.paint(color, depth, part, setting, soft);
  }

  #boxes(): Box3[] {
    const origin = this.#map.getViewState()?.origin;
    return origin ? [...this.#members.values()].flatMap((member) => member.boxes(origin)) : [];
  }

  #targetOf({ width, height }: Part): ThreeTarget {
    if (this.#target?.width === width && this.#target.height === height) return this.#target;
    this.#target?.dispose();
    return new this.#three.WebGLRenderTarget(width, height, { samples: SAMPLES, colorSpace: "srgb", depthTexture: new this.#three.DepthTexture(width, height) as never });
  }

  /** The camera stands in the middle of what it sees, so that numbers are small on the GPU. */
  #aim(setting: FrameState, part: Part, [near, far]: Vec2): void {
    const { right, up, forward } = setting.camera.frame.axes;
    const [left, top, px] = groundOf(part, setting);
    const [w, h, d] = [part.width * px, part.height * px, (near + far) / 2];
    const [x, y, z] = localFromUvd(setting.camera.frame.axes, [left + w / 2, top - h / 2, d]);
    Object.assign(this.#camera, { left: -w / 2, right: w / 2, top: h / 2, bottom: -h / 2, near: near - d, far: far - d, matrixWorldNeedsUpdate: true });
    this.#camera.matrix.set(right[0], up[0], -forward[0], x, right[1], up[1], -forward[1], y, right[2], up[2], -forward[2], z, 0, 0, 0, 1);
    this.#camera.updateProjectionMatrix();
  }

  #shine({ light }: FrameState): void {
    const { sky_rgb, sky, sun_rgb, sun, towards } = lampsOf(light);
    this.#sky.color.setRGB(...sky_rgb);
    this.#sky.intensity = sky;
    this.#sun.color.setRGB(...sun_rgb);
    this.#sun.intensity = sun;
    this.#sun.position.set(...towards);
  }

  // What the map tells

  /** Time passes with the frames that are drawn; what moves asks for the next. */
  readonly #drawn = (): void => {
    const now = performance.now();
    const seconds = Math.min((now - (this.#last_ms ?? now)) / 1000, LONGEST_STEP_S);
    const moving = [...this.#members.values()].filter((member) => member.step(seconds)).length > 0 && !this.#lost;
    this.#last_ms = moving ? now : null;
    if (moving) this.#map.layerContext?.requestFrame();
  };

  readonly #gone = (): void => {
    this.#lost = true;
    this.#composite = undefined;
  };

  readonly #back = (): void => {
    this.#lost = false;
    if (this.#map.drawer !== "webgl") for (const member of [...this.#members.values()]) member.failed(new UsageError(NO_CANVAS));
  };

  readonly #clicked = ({ point }: { point: Vec2 }): void => {
    const found = this.#hit(point);
    found?.member.clicked(point, found.position, found.hit);
  };

  readonly #moved = ({ point }: { point: Vec2 }): void => {
    this.#map.container.classList.toggle("map3d-over-model", this.#hit(point) !== null);
  };

  /** The nearest model under a point of the screen, when it is listened to and no image hides it as far as depths are known. */
  #hit(point: Vec2): { member: Member; position: Vec3; hit: ThreeHit } | null {
    const { relief, inTransition } = this.#map;
    if (!relief || inTransition || ![...this.#members.values()].some(({ listening }) => listening)) return null;
    const { camera, origin } = relief;
    const { axes } = camera.frame;
    const [near] = depthsOf(this.#boxes(), camera.frame) ?? [0];
    const [u, v] = uvFromScreen(camera, point);
    const ray = new this.#three.Raycaster();
    ray.camera = this.#camera;
    ray.params.Line.threshold = ray.params.Points.threshold = NEAR_PX * cssPixelM(camera);
    ray.set(new this.#three.Vector3(...localFromUvd(axes, [u, v, near - 1])), new this.#three.Vector3(...axes.forward));
    const hit = ray.intersectObjects([...this.#members.keys()], true).find(({ object }) => isShown(object));
    if (!hit) return null;
    const local: Vec3 = [hit.point.x, hit.point.y, hit.point.z];
    const member = this.#memberOf(hit.object);
    const d = axes.forward[0] * local[0] + axes.forward[1] * local[1] + axes.forward[2] * local[2];
    return member?.listening && !relief.isOccluded(u, v, d) ? { member, position: add(origin, local), hit } : null;
  }

  #memberOf(node: ThreeNode): Member | undefined {
    let at: ThreeNode | null = node;
    while (at && !this.#members.has(at)) at = at.parent;
    return at ? this.#members.get(at) : undefined;
  }
}

function isShown(node: ThreeNode): boolean {
  return node.visible && (!node.parent || isShown(node.parent));
}
