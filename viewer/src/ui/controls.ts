import { element, iconButton } from "../core/dom";
import { getMapMessages, type MapMessages } from "../core/i18n";

/** What the buttons need of a map. */
export interface ControlledMap {
  readonly zoom: number;
  readonly zoomLimits: readonly [number, number];
  readonly lookAt_deg: number;
  readonly language: string;
  readonly directions: readonly { id: string; lookAtDeg: number }[];
  zoomIn(): unknown;
  zoomOut(): unknown;
  rotate(step: number): unknown;
  setDirection(id: string): unknown;
  on(type: "zoom" | "directionchange", listener: () => void): unknown;
  /** What fills the screen. */
  readonly container: HTMLElement;
}

const PLUS = "M12 5v14M5 12h14";
const MINUS = "M5 12h14";
const LEFT = "M4 10a8 8 0 1 1 2.3 7.6M4 4v6h6";
const WHOLE = "M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5";
const PART = "M9 4v5H4M20 9h-5V4M15 20v-5h5M4 15h5v5";
const RIGHT = "M20 10a8 8 0 1 0-2.3 7.6M20 4v6h-6";

/** Zoom buttons, a compass with buttons that turn the view when there are several, and one that fills the screen where that can be done. */
export function createControls(map: ControlledMap): HTMLElement {
  const words = getMapMessages(map.language);
  const whole = document.fullscreenEnabled ? [screenGroup(map, words)] : [];
  return element("div", "map3d-buttons", {}, ...whole, turnGroup(map, words), zoomGroup(map, words));
}

/** The whole page fills the screen, with all that lies on the map. */
function screenGroup({ container }: ControlledMap, words: MapMessages): HTMLElement {
  const button = iconButton("", words.fill, WHOLE);
  const group = element("div", "map3d-group", { role: "group", "aria-label": words.screen }, button);
  const isWhole = (): boolean => document.fullscreenElement !== null;
  button.addEventListener("click", () => {
    // Refused without a user's gesture, or by the page's policy: then all stays as it is.
    void (isWhole() ? document.exitFullscreen() : document.documentElement.requestFullscreen()).catch(() => undefined);
  });
  const show = (): void => {
    if (!container.isConnected) document.removeEventListener("fullscreenchange", show);
    button.querySelector("path")?.setAttribute("d", isWhole() ? PART : WHOLE);
    button.setAttribute("aria-label", isWhole() ? words.leave : words.fill);
  };
  document.addEventListener("fullscreenchange", show);
  return group;
}

function zoomGroup(map: ControlledMap, words: MapMessages): HTMLElement {
  const [inward, outward] = [iconButton("", words.zoomIn, PLUS), iconButton("", words.zoomOut, MINUS)];
  inward.addEventListener("click", () => map.zoomIn());
  outward.addEventListener("click", () => map.zoomOut());
  map.on("zoom", () => {
    const [least, greatest] = map.zoomLimits;
    outward.disabled = map.zoom <= least + 1e-3;
    inward.disabled = map.zoom >= greatest - 1e-3;
  });
  return element("div", "map3d-group", { role: "group", "aria-label": words.zoom }, inward, outward);
}

function turnGroup(map: ControlledMap, words: MapMessages): HTMLElement {
  const [left, right, compass] = [iconButton("", words.left, LEFT), iconButton("", words.right, RIGHT), compassButton(words)];
  const group = element("div", "map3d-group", { role: "group", "aria-label": words.direction }, compass, left, right);
  left.addEventListener("click", () => map.rotate(1));
  right.addEventListener("click", () => map.rotate(-1));
  compass.addEventListener("click", () => {
    const [northmost] = [...map.directions].sort((a, b) => fromNorth(a.lookAtDeg) - fromNorth(b.lookAtDeg));
    if (northmost) map.setDirection(northmost.id);
  });
  map.on("directionchange", () => {
    (compass.firstElementChild as SVGElement).style.transform = `rotate(${String(map.lookAt_deg)}deg)`;
    compass.setAttribute("aria-label", words.looking(words.winds[computeWind(map.lookAt_deg)] as string));
    left.hidden = right.hidden = map.directions.length < 2;
  });
  return group;
}

/** A needle that points to where north is on the screen. */
function compassButton({ north }: MapMessages): HTMLButtonElement {
  const button = iconButton("map3d-compass", north, "M12 2l4 10h-8z");
  const needle = button.querySelector("path");
  needle?.classList.add("map3d-north");
  const tail = needle?.cloneNode() as SVGPathElement;
  tail.setAttribute("d", "M12 22l4-10h-8z");
  tail.setAttribute("class", "map3d-south");
  needle?.after(tail);
  return button;
}

/** The wind's place among the eight, counter-clockwise from north, of a look-at angle. */
export const computeWind = (lookAtDeg: number): number => Math.round((((lookAtDeg % 360) + 360) % 360) / 45) % 8;

const fromNorth = (deg: number): number => Math.min(deg, 360 - deg);
