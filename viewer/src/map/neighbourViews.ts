import type { Frame } from "../geo/frame";
import type { Rendering } from "../geo/manifest";

/** The view `step` directions further counter-clockwise, of the same pitch; the same view when there is no other. */
export function findNeighbourView(rendering: Rendering, frame: Frame, step: number): string {
  const frames = [...rendering.views.values()].map((view) => view.frame);
  const ring = frames.filter(({ pitchDeg }) => pitchDeg === frame.pitchDeg).sort((a, b) => a.lookAtDeg - b.lookAtDeg);
  const at = ring.findIndex(({ id }) => id === frame.id);
  return ring[(((at + step) % ring.length) + ring.length) % ring.length]?.id ?? frame.id;
}

/** The view of the next pitch, +1 steeper, whose direction is nearest; null when no pitch is left. */
export function findTiltedView(rendering: Rendering, frame: Frame, step: number): string | null {
  const beyond = [...rendering.views.values()].map((view) => view.frame).filter(({ pitchDeg }) => Math.sign(pitchDeg - frame.pitchDeg) === Math.sign(step));
  const turn = ({ lookAtDeg }: Frame): number => Math.abs((((lookAtDeg - frame.lookAtDeg + 180) % 360) + 360) % 360 - 180);
  const [best] = beyond.sort((a, b) => Math.abs(a.pitchDeg - frame.pitchDeg) - Math.abs(b.pitchDeg - frame.pitchDeg) || turn(a) - turn(b));
  return best?.id ?? null;
}
