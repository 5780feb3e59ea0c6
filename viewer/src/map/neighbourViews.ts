import type { Frame } from "../geo/frame";
import type { Rendering } from "../geo/manifest";

/** Finds the view of the same pitch `step` directions counter-clockwise; the same view when it is the only one. */
export function findNeighbourView(rendering: Rendering, frame: Frame, step: number): string {
  const frames = [...rendering.views.values()].map((view) => view.frame);
  const ring = frames.filter(({ pitch_deg }) => pitch_deg === frame.pitch_deg).sort((a, b) => a.lookAt_deg - b.lookAt_deg);
  const at = ring.findIndex(({ id }) => id === frame.id);
  return ring[(((at + step) % ring.length) + ring.length) % ring.length]?.id ?? frame.id;
}

/** Finds the view of the next pitch, +1 steeper, with the nearest look-at angle; null when there is no further pitch. */
export function findTiltedView(rendering: Rendering, frame: Frame, step: number): string | null {
  const candidates = [...rendering.views.values()]
    .map((view) => view.frame)
    .filter(({ pitch_deg }) => Math.sign(pitch_deg - frame.pitch_deg) === Math.sign(step));
  const angle = ({ lookAt_deg }: Frame): number => Math.abs(((((lookAt_deg - frame.lookAt_deg + 180) % 360) + 360) % 360) - 180);
  const [best] = candidates.sort(
    (a, b) => Math.abs(a.pitch_deg - frame.pitch_deg) - Math.abs(b.pitch_deg - frame.pitch_deg) || angle(a) - angle(b),
  );
  return best?.id ?? null;
}
