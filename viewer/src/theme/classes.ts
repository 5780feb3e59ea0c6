import { floorToRound } from "../core/lengths";
import type { AttributeInfo, AttributeValue, ColumnSummary } from "../map3d";

/** Objects of one colour. */
export interface ThemeClass {
  /** Label in the legend. */
  readonly label: string;
  /** #rrggbb */
  readonly color: string;
  /** Its objects; in a large rendering, those that have been in view. */
  readonly ids: readonly number[];
}

export interface Classification {
  readonly classes: readonly ThemeClass[];
  /** The classes have an order, such as ranges of numbers. */
  readonly ordered: boolean;
  /** Adds objects to their classes. */
  readonly add: (column: ReadonlyMap<number, AttributeValue>) => void;
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

type Summary = Pick<ColumnSummary, "values" | "numbers">;

/** Classes without objects, and the class of a value. */
interface Classes {
  readonly labels: readonly string[];
  readonly colors: readonly string[];
  readonly classOf: (value: AttributeValue) => number;
}

/** Classifies numbers by range and everything else by value. Text counts as numbers if all values are numeric. @param summary of the whole column; by default, `column` is the whole */
export function classify(
  { type }: Pick<AttributeInfo, "type">,
  column: ReadonlyMap<number, AttributeValue>,
  options: ClassOptions,
  summary: Summary = summarize(type, column),
): Classification {
  const { values, numbers } = summary;
  const ranges = numbers && values.length > options.classes && (type === "number" || values.length > 12);
  const ordered = numbers !== undefined && type === "number";
  const { labels, colors, classOf } = ranges ? classifyByRange(numbers, options) : classifyByValue(values, ordered, options);
  const classes = labels.map((label, k) => ({ label, color: colors[k] as string, ids: [] as number[] }));
  const add = (more: typeof column): void => {
    for (const [id, value] of more) classes[classOf(value)]?.ids.push(id);
  };
  add(column);
  return { classes, ordered: ranges ? true : ordered && classes.length <= 6, add };
}

function summarize(type: AttributeInfo["type"], column: ReadonlyMap<number, AttributeValue>): Summary {
  const counts = new Map<AttributeValue, number>();
  for (const value of column.values()) counts.set(value, (counts.get(value) ?? 0) + 1);
  const numbers = Array.from(column.values(), (value) =>
    type === "boolean" || (typeof value === "string" && value.trim() === "") ? NaN : Number(value),
  );
  return numbers.every(Number.isFinite) ? { values: [...counts], numbers: numbers.sort((a, b) => a - b) } : { values: [...counts] };
}

/** Classes of about equal counts, with rounded bounds. */
function classifyByRange(sorted: readonly number[], { classes, colors, language }: ClassOptions): Classes {
  const bounds = classBounds(sorted, classes);
  const format = numberFormat(sorted, language);
  const labels = [...bounds, Infinity].map((_, k) => rangeLabel(bounds[k - 1], bounds[k], format));
  return {
    labels,
    colors: interpolateRamp(colors ?? RAMP, labels.length),
    classOf: (value) => bounds.filter((bound) => Number(value) >= bound).length,
  };
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
function classifyByValue(values: Summary["values"], ordered: boolean, { colors, language, otherLabel }: ClassOptions): Classes {
  const palette = colors ?? (ordered ? interpolateRamp(RAMP, values.length) : HUES);
  const frequent = [...values].sort((a, b) => b[1] - a[1] || compare(a[0], b[0], language)).map(([value]) => value);
  const kept = frequent.slice(0, palette.length);
  if (ordered) kept.sort((a, b) => compare(a, b, language));
  const numbers = new Map(kept.map((value, k) => [value, k]));
  const others = frequent.length > kept.length ? [otherLabel] : [];
  return {
    labels: [...kept.map(String), ...others],
    colors: [...palette.slice(0, kept.length), OTHER_COLOR],
    classOf: (value) => numbers.get(value) ?? kept.length,
  };
}

const compare = (a: AttributeValue, b: AttributeValue, language: string | undefined): number =>
  typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), language, { numeric: true });

/** Returns evenly spaced colours along a ramp, by linear interpolation. */
export function interpolateRamp(ramp: readonly string[], count: number): string[] {
  return Array.from({ length: count }, (_, k) => {
    const at = count === 1 ? 0 : (k / (count - 1)) * (ramp.length - 1);
    const [from, to] = [ramp[Math.floor(at)] as string, ramp[Math.ceil(at)] as string];
    const channel = (color: string, place: number): number => parseInt(color.slice(1 + 2 * place, 3 + 2 * place), 16);
    const bytes = [0, 1, 2].map((place) =>
      Math.round(channel(from, place) + (channel(to, place) - channel(from, place)) * (at - Math.floor(at))),
    );
    return `#${bytes.map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
  });
}
