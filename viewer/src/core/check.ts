import { UsageError } from "./errors";

/** Expected where a world position is. */
const POSITION = "[x, y, z], metres in the scene's CRS";

/** Formats a wrong value for a message. */
const show = (value: unknown): string =>
  value === undefined
    ? "undefined"
    : JSON.stringify(value, (_, part: unknown) => (typeof part === "number" && !Number.isFinite(part) ? String(part) : part));

/** Checks a world position, or another vector. @throws UsageError when it has fewer than `count` finite numbers */
export function checkVector<V extends readonly number[]>(value: V, name: string, expected = POSITION, count = 3): V {
  const parts = (value as V | undefined | null) ?? [];
  for (let k = 0; k < count; k++) if (!Number.isFinite(parts[k])) throw new UsageError(`${name}: expected ${expected}, got ${show(value)}`);
  return value;
}

/** Checks a number, which may be infinite if it is limited later. @throws UsageError */
export function checkNumber<N extends number | undefined>(value: N, name: string): N {
  if (value !== undefined && (typeof value !== "number" || Number.isNaN(value)))
    throw new UsageError(`${name}: expected a number, got ${show(value)}`);
  return value;
}

/** Checks that options have known names. @throws UsageError */
export function checkOptions(options: object, known: readonly string[]): void {
  for (const name of Object.keys(options))
    if (!known.includes(name)) throw new UsageError(`unknown option "${name}"; use ${known.join(", ")}`);
}
