import type { ImageLayer, Map3D } from "../map3d";

type ViewState = NonNullable<ReturnType<Map3D["getViewState"]>>;

/** While the sun is lower, level ground has less than half of the light that it has in thumbnails. */
const LOWEST_SUN_DEG = 10;
/** JSON of window and image, whose numbers and text can be written into CSS as they are. */
const THUMBNAIL = /^\[\[([\d.]+),([\d.]+),([\d.]+),([\d.]+)],"([\w+/=]+)"]$/;

/**
 * Shows the thumbnail of a layer's view behind the canvas until everything in view is drawn. It is the map's background, so that it takes no room and no
 * pointer events. None is shown when it is malformed, and when the layer looks different: in another mode, or in low light.
 */
export function showThumbnail(map: Map3D, layer: ImageLayer): void {
  const { style } = map.container;
  const update = (): void => {
    const [{ rendering }, { frame, u, v, zoom, width, height }] = [layer, (map.getViewState() as ViewState).camera];
    const thumbnail = rendering?.json.views.find(({ id }) => rendering.views.get(id)?.frame === frame)?.thumbnail;
    const [, left, top, across, down, webp] = THUMBNAIL.exec(JSON.stringify([thumbnail?.window, thumbnail?.webp])) ?? [];
    const scale = 2 ** zoom; // CSS pixels of a pixel of level 0
    const px_m = map.metresPerPixel;
    const place = `${Number(left) * scale + (frame.u0 - u) / px_m + width / 2}px ${Number(top) * scale + (v - frame.v0) / px_m + height / 2}px/${Number(across) * scale}px ${Number(down) * scale}px`;
    const isShown = webp && layer.mode === "lit" && layer.opacity === 1 && map.light.elevation_deg >= LOWEST_SUN_DEG;
    style.background = isShown ? `url(data:image/webp;base64,${webp}) ${place} no-repeat,var(--map3d-background)` : "";
  };
  map.frameEvents.on("draw", update);
  map.once("load", () => {
    map.frameEvents.off("draw", update);
    style.background = "";
  });
}
