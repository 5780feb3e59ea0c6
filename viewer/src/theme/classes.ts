import { floorToRound } from "../core/lengths";
import type { AttributeInfo, AttributeValue } from "../map3d";

/** Objects of one colour. */
export interface ThemeClass {
  /** Label in the legend. */
  readonly label: string;
  /** #rrggbb */
  readonly color: string;
  readonly ids: readonly number[];
}

export interface Classification {
  readonly classes: readonly ThemeClass[];
  /** The classes have an order, such as ranges of numbers. */
  readonly ordered: boolean;
}

/** Sequential palette, light to dark; readable in greyscale and with colour blindness. */
export const RAMP: readonly string[] = ["#fbe3a8", "#f2b077", "#d97568", "#9d4772", "#4f2a6d"];
/** Categorical palette after Okabe and Ito, distinguishable with colour blindness. */
export const HUES: readonly string[] = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442"];
export const OTHER_COLOR = "#8f9296";

export interface ClassOptions {
  readonly classes: number;
  readonly colors: readonly string[] | undefined;
  readonly language: string | undefined;
  /** Label of values without their own class. */
  readonly otherLabel: string;
}

type ValueEntry = readonly [id: number, value: AttributeValue];

/** Classifies numbers by range and everything else by value. Text counts as numbers if all values are numeric. */
export function classify(info: Pick<AttributeInfo, "type">, column: ReadonlyMap<number, AttributeValue>, options: ClassOptions): Classification {
  const entries = [...column];
  const variety = new Set(entries.map(([, value]) => value)).size;
  const numbers = info.type === "boolean" ? null : entries.map(([id, value]) => [id, typeof value === "string" && value.trim() === "" ? NaN : Number(value)] as const);
  const numeric = numbers?.every(([, value]) => Number.isFinite(value)) === true;
  if (numeric && variety > options.classes && (info.type === "number" || variety > 12)) return { classes: classifyByRange(numbers, options), ordered: true };
  const ordered = numeric && info.type === "number";
  const classes = classifyByValue(entries, ordered, options);
  return { classes, ordered: ordered && classes.length <= 6 };
}

/** Classes of about equal counts, with rounded bounds. */
function classifyByRange(entries: readonly (readonly [number, number])[], { classes, colors, language }: ClassOptions): ThemeClass[] {
  const sorted = entries.map(([, value]) => value).sort((a, b) => a - b);
  const bounds = classBounds(sorted, classes);
  const format = numberFormat(sorted, language);
  const groups = [...bounds, Infinity].map<number[]>(() => []);
  for (const [id, value] of entries) groups[bounds.filter((bound) => value >= bound).length]?.push(id);
  const ramp = interpolateRamp(colors ?? RAMP, groups.length);
  return groups.map((ids, k) => ({ ids, color: ramp[k] as string, label: rangeLabel(bounds[k - 1], bounds[k], format) }));
}

/** Returns the lower bounds of all classes but the first. */
export function classBounds(sorted: readonly number[], classes: number): number[] {
  const at = (share: number): number => sorted[Math.min(Math.floor(share * sorted.length), sorted.length - 1)] ?? 0;
  const [least, most] = [sorted[0] ?? 0, sorted.at(-1) ?? 0];
  const step = floorToRound((at(0.95) - at(0.05) || most - least) / (4 * classes));
  const bounds = Array.from({ length: classes - 1 }, (_, k) => Number((Math.round(at((k + 1) / classes) / step) * step).toPrecision(12)));
  return [...new Set(bounds)].filter((bound) => bound > least && bound <= most).sort((a, b) => a - b);
}

function rangeLabel(from: number | undefined, to: number | undefined, format: (value: number) => string): string {
  if (from === undefined) return to === undefined ? "" : `< ${format(to)}`;
  return to === undefined ? `≥ ${format(from)}` : `${format(from)}–${format(to)}`;
}

/** Formats numbers; integers that could be years have no thousands separators. */
function numberFormat(sorted: readonly number[], language: string | undefined): (value: number) => string {
  const years = sorted.every((value) => Number.isInteger(value)) && (sorted[0] ?? 0) >= 0 && (sorted.at(-1) ?? 0) < 10_000;
  const numbers = new Intl.NumberFormat(language, { useGrouping: !years, maximumSignificantDigits: 6 });
  return (value) => numbers.format(value);
}

/** The most frequent values, and one class for the others. */
function classifyByValue(entries: readonly ValueEntry[], ordered: boolean, { colors, language, otherLabel }: ClassOptions): ThemeClass[] {
  const groups = new Map<AttributeValue, number[]>();
  for (const [id, value] of entries) {
    const group = groups.get(value);
    if (group) group.push(id);
    else groups.set(value, [id]);
  }
  const palette = colors ?? (ordered ? interpolateRamp(RAMP, groups.size) : HUES);
  const frequent = [...groups].sort((a, b) => b[1].length - a[1].length || compare(a[0], b[0], language));
  const [kept, others] = frequent.length <= palette.length ? [frequent, []] : [frequent.slice(0, palette.length), frequent.slice(palette.length)];
  if (ordered) kept.sort((a, b) => compare(a[0], b[0], language));
  const named = kept.map(([value, ids], k) => ({ ids, color: palette[k] as string, label: String(value) }));
  return others.length === 0 ? named : [...named, { ids: others.flatMap(([, ids]) => ids), color: OTHER_COLOR, label: otherLabel }];
}

const compare = (a: AttributeValue, b: AttributeValue, language: string | undefined): number =>
  typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), language, { numeric: true });

/** Returns evenly spaced colours along a ramp, by linear interpolation. */
export function interpolateRamp(ramp: readonly string[], count: number): string[] {
  return Array.from({ length: count }, (_, k) => {
    const at = count === 1 ? 0 : (k / (count - 1)) * (ramp.length - 1);
    const [from, to] = [ramp[Math.floor(at)] as string, ramp[Math.ceil(at)] as string];
    const channel = (color: string, place: number): number => parseInt(color.slice(1 + 2 * place, 3 + 2 * place), 16);
    const bytes = [0, 1, 2].map((place) => Math.round(channel(from, place) + (channel(to, place) - channel(from, place)) * (at - Math.floor(at))));
    return `#${bytes.map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
  });
}
