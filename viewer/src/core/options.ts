import { checkOptions } from "./check";

/** A row of a table of options: the default, undefined for none, and the check. The documentation of the row is that of the option. */
export type Option<T, Default = T | undefined> = readonly [byDefault: Default, check: ((value: T, name: string) => unknown) | undefined];

/** The type of the options of a table. */
export type OptionsOf<Table> = { -readonly [K in keyof Table]?: Table[K] extends Option<infer T, unknown> ? T : never };

/** The type of the options of a table with their defaults. */
export type FilledOptionsOf<Table> = OptionsOf<Table> & {
  -readonly [K in keyof Table as Table[K] extends Option<never, undefined> ? never : K]: Table[K] extends Option<infer T, unknown>
    ? T
    : never;
};

type OptionTable = Record<string, Option<never, unknown>>;

/** Makes the row of an option without a fixed default. */
export const option = <T>(check?: Option<T>[1]): Option<T, undefined> => [undefined, check];

/** Makes the row of an option with a default. */
export const optionOr = <T>(byDefault: T, check?: Option<T>[1]): Option<T, T> => [byDefault, check];

/** Returns options with their defaults. @throws UsageError for unknown and wrong options */
export function fillOptions<Table extends OptionTable>(table: Table, options: OptionsOf<Table>): FilledOptionsOf<Table> {
  const given = options as Record<string, never>;
  const filled: Record<string, unknown> = {};
  checkOptions(options, Object.keys(table));
  for (const [name, [byDefault, check]] of Object.entries(table)) {
    check?.(given[name] as never, name);
    if (byDefault !== undefined) filled[name] = byDefault;
  }
  return { ...filled, ...given } as FilledOptionsOf<Table>;
}
