/** A label's box on a plane of pixels: its centre at the bottom, and its size. */
export interface LabelBox {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
  readonly rank: number;
  /** Whether it is shown already: then it stays, so that nothing flickers. */
  readonly shown: boolean;
}

/** Space between labels. */
const GAP_PX = 4;

/** Chooses labels that do not overlap: those that are shown first, then by rank. Returns whether each is chosen. */
export function chooseLabels(boxes: readonly LabelBox[]): boolean[] {
  const order = boxes
    .map((box, k) => ({ box, k }))
    .sort((a, b) => Number(b.box.shown) - Number(a.box.shown) || b.box.rank - a.box.rank || a.k - b.k);
  const chosen: LabelBox[] = [];
  const result = boxes.map(() => false);
  for (const { box, k } of order) {
    if (chosen.some((other) => overlaps(box, other))) continue;
    chosen.push(box);
    result[k] = true;
  }
  return result;
}

const overlaps = (a: LabelBox, b: LabelBox): boolean =>
  Math.abs(a.x - b.x) < (a.width + b.width) / 2 + GAP_PX && a.y - a.height - GAP_PX < b.y && b.y - b.height - GAP_PX < a.y;
