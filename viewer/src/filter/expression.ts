import { UsageError, type AttributeValue } from "../map3d";

/** A condition on an object's attributes, as an array: a small part of MapLibre's expressions. Attributes are given by name; one that an object lacks fulfils only `"!="`, `"!in"` and `"!has"`. */
export type FilterExpression =
  | readonly ["all" | "any" | "none", ...FilterExpression[]]
  | readonly ["==" | "!=" | "<" | "<=" | ">" | ">=", string, AttributeValue]
  | readonly ["in" | "!in", string, ...AttributeValue[]]
  | readonly ["has" | "!has", string];

/** Returns an object's value of an attribute; undefined if it has none. */
export type ValueOf = (attribute: string) => AttributeValue | undefined;

type Operands = readonly unknown[];
type Test = (valueOf: ValueOf, operands: Operands) => boolean;

const compare =
  (holds: (order: number) => boolean): Test =>
  (valueOf, [name, wanted]) => {
    const value = valueOf(name as string);
    // Numbers may be stored as text.
    const [a, b] = typeof wanted === "number" ? [toNumber(value), wanted] : [value, wanted as string];
    return typeof a === typeof b && a !== undefined && !Number.isNaN(a) && holds(a < b ? -1 : a > b ? 1 : 0);
  };
const toNumber = (value: AttributeValue | undefined): number =>
  typeof value === "number" ? value : typeof value === "string" && value.trim() !== "" ? Number(value) : NaN;
const equals = (value: AttributeValue | undefined, wanted: unknown): boolean =>
  value === wanted || (typeof wanted === "number" && toNumber(value) === wanted);
const isIn: Test = (valueOf, [name, ...list]) => list.some((wanted) => equals(valueOf(name as string), wanted));
const has: Test = (valueOf, [name]) => valueOf(name as string) !== undefined;
const not =
  (test: Test): Test =>
  (valueOf, operands) =>
    !test(valueOf, operands);
const some: Test = (valueOf, parts) => parts.some((part) => matches(part as FilterExpression, valueOf));

const GROUPS: Readonly<Record<string, Test>> = {
  all: (valueOf, parts) => parts.every((part) => matches(part as FilterExpression, valueOf)),
  any: some,
  none: not(some),
};
const TESTS: Readonly<Record<string, Test>> = {
  "==": isIn,
  "!=": not(isIn),
  "<": compare((order) => order < 0),
  "<=": compare((order) => order <= 0),
  ">": compare((order) => order > 0),
  ">=": compare((order) => order >= 0),
  in: isIn,
  "!in": not(isIn),
  has,
  "!has": not(has),
};

/** Whether an object fulfils a checked expression. */
export function matches([operator, ...operands]: FilterExpression, valueOf: ValueOf): boolean {
  return (GROUPS[operator] ?? TESTS[operator])?.(valueOf, operands) === true;
}

/** Checks an expression, and lists the attributes that it names. @throws UsageError that says what it can be */
export function checkExpression(expression: unknown): Set<string> {
  const [operator, ...operands] = Array.isArray(expression) ? (expression as unknown[]) : [];
  if (typeof operator === "string" && Object.hasOwn(GROUPS, operator))
    return new Set(operands.flatMap((part) => [...checkExpression(part)]));
  const isKnown = typeof operator === "string" && Object.hasOwn(TESTS, operator);
  const [name, ...values] = operands;
  const count = String(operator).endsWith("has") ? 0 : String(operator).endsWith("in") ? values.length : 1;
  const isOrder = /^[<>]/.test(String(operator));
  const fits = values.every((value) => ["string", "number"].includes(typeof value) || (typeof value === "boolean" && !isOrder));
  if (!isKnown || typeof name !== "string" || values.length !== count || !fits)
    throw new UsageError(
      `expected a filter such as ["all", [">", "height", 20], ["==", "class", "building"]] with ${[...Object.keys(GROUPS), ...Object.keys(TESTS)].join(", ")}; got ${expression === undefined ? "undefined" : JSON.stringify(expression)}`,
    );
  return new Set([name]);
}
