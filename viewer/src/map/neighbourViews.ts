import type { Frame } from "../geo/frame";
import type { Rendering } from "../geo/manifest";

/** Finds the view of the same pitch `step` directions counter-clockwise; the same view when it is the only one. */
export function findNeighbourView(rendering: Rendering, frame: Frame, step: number): string {
  const frames = [...rendering.views.values()].map((view) => view.frame);
  const ring = frames.filter(({ pitchDeg }) => pitchDeg === frame.pitchDeg).sort((a, b) => a.lookAtDeg - b.lookAtDeg);
  const at = ring.findIndex(({ id }) => id === frame.id);
  return ring[(((at + step) % ring.length) + ring.length) % ring.length]?.id ?? frame.id;
}

/** Finds the view of the next pitch, +1 steeper, with the nearest look-at angle; null when there is no further pitch. */
export function findTiltedView(rendering: Rendering, frame: Frame, step: number): string | null {
  const candidates = [...rendering.views.values()]
    .map((view) => view.frame)
    .filter(({ pitchDeg }) => Math.sign(pitchDeg - frame.pitchDeg) === Math.sign(step));
  const angle = ({ lookAtDeg }: Frame): number => Math.abs(((((lookAtDeg - frame.lookAtDeg + 180) % 360) + 360) % 360) - 180);
  const [best] = candidates.sort(
    (a, b) => Math.abs(a.pitchDeg - frame.pitchDeg) - Math.abs(b.pitchDeg - frame.pitchDeg) || angle(a) - angle(b),
  );
  return best?.id ?? null;
}
