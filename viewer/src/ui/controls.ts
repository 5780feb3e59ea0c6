import { element, iconButton } from "../core/dom";
import { getMapMessages, type MapMessages } from "../core/i18n";

/** A map as seen by its buttons. */
export interface ControlledMap {
  readonly zoom: number;
  readonly zoomLimits: readonly [number, number];
  readonly lookAt_deg: number;
  readonly language: string;
  readonly directions: readonly { id: string; lookAt_deg: number }[];
  zoomIn(): unknown;
  zoomOut(): unknown;
  rotate(step: number): unknown;
  setDirection(id: string): unknown;
  on(type: "zoom" | "directionchange", listener: () => void): unknown;
  readonly container: HTMLElement;
}

const PLUS = "M12 5v14M5 12h14";
const MINUS = "M5 12h14";
const LEFT = "M4 10a8 8 0 1 1 2.3 7.6M4 4v6h6";
const ENTER_FULL_SCREEN = "M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5";
const EXIT_FULL_SCREEN = "M9 4v5H4M20 9h-5V4M15 20v-5h5M4 15h5v5";
const RIGHT = "M20 10a8 8 0 1 0-2.3 7.6M20 4v6h-6";

/** Creates the zoom buttons, the compass, buttons that turn the view if there are several, and a full-screen button where the browser allows it. */
export function createControls(map: ControlledMap): HTMLElement {
  const messages = getMapMessages(map.language);
  const fullScreen = document.fullscreenEnabled ? [createFullScreenGroup(map, messages)] : [];
  return element("div", "map3d-buttons", {}, ...fullScreen, createRotateGroup(map, messages), createZoomGroup(map, messages));
}

/** Shows the whole page in full screen, so that everything above the map stays visible. */
function createFullScreenGroup({ container }: ControlledMap, messages: MapMessages): HTMLElement {
  const button = iconButton("", messages.enterFullScreen, ENTER_FULL_SCREEN);
  const group = element("div", "map3d-group", { role: "group", "aria-label": messages.fullScreen }, button);
  const isFullScreen = (): boolean => document.fullscreenElement !== null;
  button.addEventListener("click", () => {
    // The browser may refuse, e.g. without a user gesture; then nothing changes.
    void (isFullScreen() ? document.exitFullscreen() : document.documentElement.requestFullscreen()).catch(() => undefined);
  });
  const update = (): void => {
    if (!container.isConnected) document.removeEventListener("fullscreenchange", update);
    button.querySelector("path")?.setAttribute("d", isFullScreen() ? EXIT_FULL_SCREEN : ENTER_FULL_SCREEN);
    button.setAttribute("aria-label", isFullScreen() ? messages.exitFullScreen : messages.enterFullScreen);
  };
  document.addEventListener("fullscreenchange", update);
  return group;
}

function createZoomGroup(map: ControlledMap, messages: MapMessages): HTMLElement {
  const [zoomIn, zoomOut] = [iconButton("", messages.zoomIn, PLUS), iconButton("", messages.zoomOut, MINUS)];
  zoomIn.addEventListener("click", () => map.zoomIn());
  zoomOut.addEventListener("click", () => map.zoomOut());
  map.on("zoom", () => {
    const [least, greatest] = map.zoomLimits;
    zoomOut.disabled = map.zoom <= least + 1e-3;
    zoomIn.disabled = map.zoom >= greatest - 1e-3;
  });
  return element("div", "map3d-group", { role: "group", "aria-label": messages.zoom }, zoomIn, zoomOut);
}

function createRotateGroup(map: ControlledMap, messages: MapMessages): HTMLElement {
  const [left, right, compass] = [
    iconButton("", messages.rotateLeft, LEFT),
    iconButton("", messages.rotateRight, RIGHT),
    createCompass(messages),
  ];
  const group = element("div", "map3d-group", { role: "group", "aria-label": messages.direction }, compass, left, right);
  left.addEventListener("click", () => map.rotate(1));
  right.addEventListener("click", () => map.rotate(-1));
  compass.addEventListener("click", () => {
    const [northmost] = [...map.directions].sort((a, b) => angleFromNorth(a.lookAt_deg) - angleFromNorth(b.lookAt_deg));
    if (northmost) map.setDirection(northmost.id);
  });
  map.on("directionchange", () => {
    (compass.firstElementChild as SVGElement).style.transform = `rotate(${String(map.lookAt_deg)}deg)`;
    compass.setAttribute("aria-label", messages.facing(messages.winds[computeWind(map.lookAt_deg)] as string));
    left.hidden = right.hidden = map.directions.length < 2;
  });
  return group;
}

/** Creates the compass, whose needle points north on the screen. */
function createCompass({ north }: MapMessages): HTMLButtonElement {
  const button = iconButton("map3d-compass", north, "M12 2l4 10h-8z");
  const needle = button.querySelector("path");
  needle?.classList.add("map3d-north");
  const tail = needle?.cloneNode() as SVGPathElement;
  tail.setAttribute("d", "M12 22l4-10h-8z");
  tail.setAttribute("class", "map3d-south");
  needle?.after(tail);
  return button;
}

/** Returns the index of a look-at angle's wind among the eight winds, counter-clockwise from north. */
export const computeWind = (lookAt_deg: number): number => Math.round((((lookAt_deg % 360) + 360) % 360) / 45) % 8;

const angleFromNorth = (deg: number): number => Math.min(deg, 360 - deg);
