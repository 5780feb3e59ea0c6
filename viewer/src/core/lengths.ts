/** Longest scale bar, CSS pixels. */
export const SCALE_BAR_MAX_PX = 110;

/** Rounds down to 1, 2 or 5 times a power of ten. */
export function floorToRound(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  const digit = value / power;
  return power * (digit >= 5 ? 5 : digit >= 2 ? 2 : 1);
}

/** Formats a round number of metres. */
export const formatLength = (metres: number): string =>
  metres >= 1000 ? `${String(metres / 1000)} km` : metres >= 1 ? `${String(metres)} m` : `${String(Math.round(metres * 100))} cm`;
