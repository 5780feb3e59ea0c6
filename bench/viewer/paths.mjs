// Camera paths: steps { x, y, mpp, look } (see pages/common.js), all inside the central district of the cities.

const START = { x: 0, y: 0, mpp: 0.3, look: 0 };
const RADIUS_M = 30;

const many = (count, step) => Array.from({ length: count }, (_, k) => step((k + 1) / count));

/** A circle that starts and ends at its western point. */
const circle = (count, from, radius = RADIUS_M) => many(count, (t) => ({ ...from, x: radius * (1 - Math.cos(2 * Math.PI * t)) - radius + from.x, y: radius * Math.sin(2 * Math.PI * t) + from.y }));

const zoomed = (count, from, low, high) => many(count, (t) => {
  const wave = Math.sin(2 * Math.PI * t);
  return { ...from, mpp: from.mpp * (wave < 0 ? high : 1 / low) ** Math.abs(wave) };
});

/** The district on a phone: pan, zoom, turn to the west, pan, turn back. */
export const district = (length) => {
  const [west, n] = [{ ...START, look: 90 }, Math.round(length / 8)];
  return { start: START, steps: [...circle(3 * n, START), ...zoomed(2 * n, START, 1.5, 1.2), ...circle(2 * n, west), ...circle(n, START)] };
};

/** A whole city, `width_m` wide. */
export const whole = (length, width_m) => {
  const from = { x: 0, y: 0, mpp: width_m / 390, look: 0 };
  const n = Math.round(length / 4);
  return { start: from, steps: [...circle(n, from, width_m / 20), ...zoomed(n, from, 1.5, 1.1), ...circle(n, { ...from, look: 90 }, width_m / 20), ...circle(n, from, width_m / 20)] };
};

/** Only panning, in one direction. */
export const pan = (length) => ({ start: START, steps: circle(length, START) });
