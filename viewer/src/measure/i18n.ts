import { selectTranslation } from "../core/i18n";

const WORDS = {
  en: { profile: "Profile", partHidden: "partly hidden", allHidden: "hidden all along", hidden: "hidden" },
  de: { profile: "Profil", partHidden: "teils verdeckt", allHidden: "ganz verdeckt", hidden: "verdeckt" },
  fr: { profile: "Profil", partHidden: "en partie caché", allHidden: "entièrement caché", hidden: "caché" },
};

/** Lengths and areas in words of the reader's language. */
export class MeasureMessages {
  readonly #numbers: (digits: number) => Intl.NumberFormat;

  readonly #words: (typeof WORDS)["en"];

  constructor(language: string | undefined) {
    this.#words = selectTranslation(WORDS, language ?? "en");
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

  /** Of a place in the CRS. */
  height(metres: number): string {
    return `${this.#numbers(Number.isInteger(metres) ? 0 : 1).format(metres)} m`;
  }

  /** From the lowest to the highest. */
  range(low: number, high: number): string {
    return `${this.#numbers(2).format(low)} – ${this.#numbers(2).format(high)} m`;
  }

  /** A place of a profile. */
  placeOf(distance_m: number, height_m: number): string {
    return `${this.length(distance_m)}  ${Number.isNaN(height_m) ? this.#words.hidden : `↕ ${this.#numbers(2).format(height_m)} m`}`;
  }

  get profile(): string {
    return this.#words.profile;
  }

  get partHidden(): string {
    return this.#words.partHidden;
  }

  get allHidden(): string {
    return this.#words.allHidden;
  }

  area(squareMetres: number): string {
    if (squareMetres >= 99_999.5) return `${this.#numbers(2).format(squareMetres / 10_000)} ha`;
    return `${this.#numbers(squareMetres >= 999.95 ? 0 : squareMetres >= 99.995 ? 1 : 2).format(squareMetres)} m²`;
  }
}
