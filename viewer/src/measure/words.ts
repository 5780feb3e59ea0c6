/** Lengths and areas in words of the reader's language. */
export class Words {
  readonly #numbers: (digits: number) => Intl.NumberFormat;

  constructor(language: string | undefined) {
    this.#numbers = (digits) => new Intl.NumberFormat(language, { minimumFractionDigits: digits, maximumFractionDigits: digits });
  }

  /** Centimetres up to 100 m, decimetres up to a kilometre. */
  length(metres: number): string {
    const size = Math.abs(metres);
    if (size >= 999.95) return `${this.#numbers(size >= 9_999.5 ? 1 : 2).format(metres / 1000)} km`;
    return `${this.#numbers(size >= 99.995 ? 1 : 2).format(metres)} m`;
  }

  /** With an arrow up or down; ± where it is level as far as the words tell. */
  rise(metres: number): string {
    const arrow = Math.abs(metres) < 0.005 ? "± " : metres < 0 ? "↓ " : "↑ ";
    return arrow + this.length(Math.abs(metres));
  }

  area(squareMetres: number): string {
    if (squareMetres >= 99_999.5) return `${this.#numbers(2).format(squareMetres / 10_000)} ha`;
    return `${this.#numbers(squareMetres >= 999.95 ? 0 : squareMetres >= 99.995 ? 1 : 2).format(squareMetres)} m²`;
  }
}
