import { clamp, type Vec2, type Vec3 } from "../core/vec";
import { computeAxes, uvdFromLocal } from "../geo/axes";
import type { Camera } from "../geo/camera";
import type { Frame } from "../geo/frame";
import { MapLayer, type TransitionFrame, type map, type ViewTransition } from "../map3d";
import { fadeOut } from "./fade";
import { Warp, type Shot } from "./warp";

export interface OrbitOptions {
  /** Of a turn by 90°; others take more or less. Default 750. */
  duration_ms?: number;
}

/** Degrees. */
interface Gaze {
  readonly lookAt: number;
  readonly pitch: number;
}

/** A change of direction under way. */
interface Turn {
  /** What was seen before, in full. */
  readonly from: Camera;
  readonly pivot: Vec3;
  /** Where it started, and when the first picture of it was there; `at` moves on from there. */
  readonly start: Gaze;
  start_ms: number | null;
  at: Gaze;
  /** Of what the map looks along: all is here. */
  complete: boolean;
  ended_ms: number | null;
  shots: [Shot, Shot] | null;
}

/** A hand that turns: where it took hold, and by how much it has turned since. */
interface Hand {
  readonly base_deg: number;
  turned_deg: number;
}

const FADE_MS = 300;
/** What more than the turned screen a picture holds, for what stands high. */
const ROOM = 1.1;
/** Texels of a picture that is turned, and pixels of what comes out, at most. */
const MOST_PX = 1.4e6;
/** How long the turned picture may stand for tiles that are still on the way. */
const PATIENCE_MS = 2500;
/** A hand that has turned so far means it. */
const MEANT_DEG = 3;

const still = (): boolean => matchMedia("(prefers-reduced-motion: reduce)").matches;
const gazeOf = ({ lookAtDeg, pitchDeg }: Frame): Gaze => ({ lookAt: lookAtDeg, pitch: pitchDeg });
/** The shorter way round, −180 to 180. */
const wayTo = (from: number, to: number): number => ((((to - from + 180) % 360) + 360) % 360) - 180;
const apart = (a: Gaze, b: Gaze): number => Math.hypot(wayTo(a.lookAt, b.lookAt), a.pitch - b.pitch);

/**
 * Makes each change of direction a movement: the pictures of both directions are turned by their depth and mixed, so that what one does not see comes from
 * the other. Two fingers, or the right mouse button, turn freely between directions; let go, the picture moves on to the nearest. A cross-fade where there
 * is no WebGL, a cut where the user wants no movement. Reads depth: its tiles are fetched.
 */
export class orbit extends MapLayer<map, object> implements ViewTransition {
  readonly needs = ["depth"] as const;
  readonly #duration_ms: number;
  #warp: Warp | undefined;
  #turn: Turn | null = null;
  #hand: Hand | null = null;

  constructor({ duration_ms = 750 }: OrbitOptions = {}) {
    super();
    this.#duration_ms = duration_ms;
  }

  protected onAdd(map: map): void {
    map.setTransition(this);
  }

  protected onRemove(map: map): void {
    this.#end();
    map.setTransition(null);
  }

  /** @internal */
  start(from: Camera, pivot: Vec3): void {
    const { drawer, drawerElement } = this.map ?? {};
    if (still() || !drawer) return;
    if (drawer === "canvas") {
      if (drawerElement) fadeOut(drawerElement, FADE_MS);
      return;
    }
    const start = this.#turn?.at ?? gazeOf(from.frame);
    this.#free();
    this.#turn = { from, pivot, start, start_ms: null, at: start, complete: false, ended_ms: null, shots: null };
  }

  /** @internal */
  rotateBy(rad: number): boolean {
    const map = this.map;
    if (!map || map.drawer !== "webgl" || still()) return false;
    this.#hand ??= { base_deg: this.#turn?.at.lookAt ?? map.lookAt_deg, turned_deg: 0 };
    this.#hand.turned_deg += (rad * 180) / Math.PI;
    const lookAt = this.#hand.base_deg + this.#hand.turned_deg;
    const beyond = wayTo(map.lookAt_deg, lookAt);
    const back = this.#turn ? wayTo(map.lookAt_deg, this.#turn.from.frame.lookAtDeg) : 0;
    const between = this.#turn && Math.sign(beyond) === Math.sign(back) && Math.abs(beyond) <= Math.abs(back);
    if (!between && Math.abs(beyond) > MEANT_DEG) map.rotate(Math.sign(beyond));
    if (this.#turn) this.#turn.at = { ...this.#turn.at, lookAt };
    map.requestTransitionFrame();
    return true;
  }

  /** @internal */
  endGesture(): void {
    const [turn, map] = [this.#turn, this.map];
    if (!this.#hand || !map) return;
    this.#hand = null;
    if (!turn) return;
    const to = map.lookAt_deg;
    if (Math.abs(wayTo(turn.at.lookAt, turn.from.frame.lookAtDeg)) < Math.abs(wayTo(turn.at.lookAt, to))) map.setDirection(turn.from.frame.id);
    else this.#turn = { ...turn, start: turn.at, start_ms: performance.now() };
  }

  /** @internal */
  step(now_ms: number, camera: Camera): Camera | null {
    const turn = this.#turn;
    if (!turn) return null;
    const goal = gazeOf(camera.frame);
    if (!this.#hand) {
      const way = apart(turn.start, goal);
      const duration_ms = clamp(this.#duration_ms * (0.35 + (0.65 * way) / 90), 1, 2 * this.#duration_ms);
      const share = clamp((now_ms - (turn.start_ms ?? now_ms)) / duration_ms, 0, 1);
      const part = share * share * (3 - 2 * share);
      turn.at = { lookAt: turn.start.lookAt + wayTo(turn.start.lookAt, goal.lookAt) * part, pitch: turn.start.pitch + (goal.pitch - turn.start.pitch) * part };
      if (share === 1) turn.ended_ms ??= now_ms;
    }
    if (turn.ended_ms !== null && (turn.complete || now_ms - turn.ended_ms > PATIENCE_MS)) {
      this.#end();
      return null;
    }
    return seenFrom(camera, turn);
  }

  /** @internal */
  draw(scene: TransitionFrame): void {
    const turn = this.#turn;
    const { gl, camera } = scene;
    if (!turn || gl.isContextLost()) return;
    if (this.#warp?.gl !== gl) this.#free();
    const warp = (this.#warp ??= this.#made(gl));
    turn.complete = scene.complete;
    turn.shots ??= [shotOf(scene, warp, turn.from, camera.frame, null), shotOf(scene, warp, camera, turn.from.frame, null)];
    const second = turn.shots[1];
    if (scene.changed || moved(second.of, camera)) turn.shots[1] = shotOf(scene, warp, camera, turn.from.frame, second);
    const goal = seenFrom(camera, turn);
    const [a, b] = [apart(turn.at, gazeOf(turn.from.frame)), apart(turn.at, gazeOf(camera.frame))];
    const share = a + b > 0 ? a / (a + b) : 1;
    const size = fitted(scene.width, scene.height);
    turn.start_ms ??= performance.now();
    warp.show(turn.shots, { camera: goal, pivot: turn.pivot, range: scene.getDepthRange(goal.frame) }, share * share * (3 - 2 * share), scene, size);
  }

  /** @throws DrawError, once: the change is a cut then */
  #made(gl: WebGL2RenderingContext): Warp {
    try {
      return new Warp(gl);
    } catch (reason) {
      this.#end();
      throw reason;
    }
  }

  #end(): void {
    this.#turn = null;
    this.#free();
  }

  #free(): void {
    this.#warp?.free();
    this.#warp = undefined;
    if (this.#turn) this.#turn.shots = null;
  }
}

/** As the map's camera, but along the direction of the moment; the pivot stays where the camera has it. */
function seenFrom(camera: Camera, { at, pivot }: Pick<Turn, "at" | "pivot">): Camera {
  const axes = computeAxes(at.lookAt, at.pitch);
  const [u, v] = uvdFromLocal(camera.frame.axes, pivot);
  const [turnedU, turnedV] = uvdFromLocal(axes, pivot);
  return { ...camera, frame: { ...camera.frame, axes, lookAtDeg: at.lookAt, pitchDeg: at.pitch }, u: turnedU + camera.u - u, v: turnedV + camera.v - v };
}

const moved = (a: Camera, b: Camera): boolean => (["u", "v", "zoom", "frame", "width", "height"] as const).some((part) => a[part] !== b[part]);

/** What a camera sees, and what lies beyond and is seen half-way to another frame, in a picture of its own. @param into whose place is taken again */
function shotOf(scene: TransitionFrame, warp: Warp, camera: Camera, other: Frame, into: Shot | null): Shot {
  const [wide, high] = turnedScreen(camera, other);
  const [width, height] = fitted(wide * (scene.width / camera.width), high * (scene.height / camera.height));
  const larger = { ...camera, width, height, zoom: camera.zoom - Math.log2(wide / width) };
  const range = scene.getDepthRange(camera.frame);
  const target = into?.target.width === width && into.target.height === height ? into.target : warp.target(width, height);
  scene.drawView(larger, range, target.framebuffer);
  return { of: camera, camera: larger, range, target };
}

/** Width and height, CSS pixels, of what the screen has covered of level ground when it has been turned half-way. */
function turnedScreen({ frame, width, height }: Camera, other: Frame): Vec2 {
  const half = (Math.abs(wayTo(frame.lookAtDeg, other.lookAtDeg)) / 2) * (Math.PI / 180);
  const flat = Math.max(0.3, Math.sin((frame.pitchDeg * Math.PI) / 180));
  const [along, across] = [Math.abs(Math.cos(half)), Math.abs(Math.sin(half))];
  return [ROOM * Math.max(width, width * along + (height * across) / flat), ROOM * Math.max(height, height * along + width * across * flat)];
}

/** At most so many pixels, in the same shape. */
function fitted(width: number, height: number): Vec2 {
  const scale = Math.min(1, Math.sqrt(MOST_PX / (width * height)));
  return [Math.max(2, Math.round(width * scale)), Math.max(2, Math.round(height * scale))];
}
