import type { Look } from "./look";

/**
 * Linear light on each pixel of a tile: half by its own normal, an eighth by each neighbour's, as the shader has it
 * (draw/webgl/shader.ts says why). Where a tile beside it is not here, the pixel's own light stands for it.
 * @param normal RGB8  @param beside tiles to the left, to the right, above, below
 */
export function lightOn(lamp: NonNullable<Look["light"]>, width: number, height: number, normal: Uint8Array, beside: readonly (Uint8Array | undefined)[]): Float32Array {
  const wide = width + 2;
  const own = new Float32Array(wide * (height + 2)).fill(NONE);
  const row = rowLighter(lamp, own);
  for (let y = 0; y < height; y++) row(normal, 3 * y * width, 3, wide * (y + 1) + 1, 1, width);
  const [left, right, above, below] = beside;
  if (left) row(left, 3 * (width - 1), 3 * width, wide, wide, height);
  if (right) row(right, 0, 3 * width, 2 * wide - 1, wide, height);
  if (above) row(above, 3 * (height - 1) * width, 3, 1, 1, width);
  if (below) row(below, 0, 3, wide * (height + 1) + 1, 1, width);
  return spread(own, width, height, lamp.ambient + 0.5 * lamp.diffuse);
}

/** Where there is no normal. */
const NONE = -1;

type Row = (normal: Uint8Array, from: number, step: number, to: number, stride: number, count: number) => void;

/** Lambert's law on a row or column of normals; equal ones in a row, which are common, are lit once. */
function rowLighter({ sun, ambient, diffuse }: NonNullable<Look["light"]>, out: Float32Array): Row {
  let [last, light] = [0, NONE];
  return (normal, from, step, to, stride, count) => {
    for (let k = 0; k < count; k++, from += step, to += stride) {
      const [r, g, b] = [normal[from] as number, normal[from + 1] as number, normal[from + 2] as number];
      const word = r | (g << 8) | (b << 16);
      if (word !== last) {
        const [x, y, z] = [2 * r - 255, 2 * g - 255, 2 * b - 255];
        const cosine = (x * sun[0] + y * sun[1] + z * sun[2]) / Math.sqrt(x * x + y * y + z * z);
        light = word === 0 ? NONE : ambient + diffuse * Math.max(0, cosine);
        last = word;
      }
      out[to] = light;
    }
  };
}

/** @param own with a border of one pixel  @param unlit light where there is no normal */
function spread(own: Float32Array, width: number, height: number, unlit: number): Float32Array {
  const wide = width + 2;
  const out = new Float32Array(width * height);
  const or = (value: number, instead: number): number => (value < 0 ? instead : value);
  for (let y = 0, to = 0; y < height; y++) {
    for (let x = 0, at = wide * (y + 1) + 1; x < width; x++, at++, to++) {
      const mine = own[at] as number;
      const around = or(own[at - 1] as number, mine) + or(own[at + 1] as number, mine) + or(own[at - wide] as number, mine) + or(own[at + wide] as number, mine);
      out[to] = mine < 0 ? unlit : 0.5 * mine + 0.125 * around;
    }
  }
  return out;
}
