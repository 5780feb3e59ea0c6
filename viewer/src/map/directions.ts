import type { Frame } from "../geo/frame";
import type { Rendering } from "../geo/manifest";

/** The view `step` directions further counter-clockwise, of the same pitch; the same view when there is no other. */
export function neighbourView(rendering: Rendering, frame: Frame, step: number): string {
  const frames = [...rendering.views.values()].map((view) => view.frame);
  const ring = frames.filter(({ pitchDeg }) => pitchDeg === frame.pitchDeg).sort((a, b) => a.lookAtDeg - b.lookAtDeg);
  const at = ring.findIndex(({ id }) => id === frame.id);
  return ring[(((at + step) % ring.length) + ring.length) % ring.length]?.id ?? frame.id;
}
