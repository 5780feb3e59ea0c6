export const ALL_ROWS = "MAP3D_ALL_ROWS";

/** Rows of a test that takes long: the first guard its law in `make test`; the others run in `make test-all`. */
export const rows = <Row>(first: readonly Row[], others: readonly Row[]): Row[] =>
  process.env[ALL_ROWS] ? [...first, ...others] : [...first];
