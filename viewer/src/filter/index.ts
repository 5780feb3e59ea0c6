/** map3d-filter: shows and finds objects by their attributes, and writes them as a table. */
export { Filter, Filter as filter, type FilterEvents, type FilterOptions } from "./filter";
export { findObjects } from "./findObjects";
export type { FilterExpression } from "./expression";
export { exportCsv, toCsv, type CsvOptions } from "./csv";
