import { selectTranslation } from "../core/i18n";

const TRANSLATIONS = {
  en: { profile: "Elevation profile", partHidden: "partly hidden", allHidden: "entirely hidden", hidden: "hidden" },
  de: { profile: "Höhenprofil", partHidden: "teilweise verdeckt", allHidden: "vollständig verdeckt", hidden: "verdeckt" },
  fr: { profile: "Profil altimétrique", partHidden: "en partie masqué", allHidden: "entièrement masqué", hidden: "masqué" },
};

/** Messages of the measuring tools, and lengths and areas formatted for the user's language. */
export class MeasureMessages {
  readonly #numbers: (digits: number) => Intl.NumberFormat;

  readonly #messages: (typeof TRANSLATIONS)["en"];

  constructor(language: string | undefined) {
    this.#messages = selectTranslation(TRANSLATIONS, language ?? "en");
    this.#numbers = (digits) => new Intl.NumberFormat(language, { minimumFractionDigits: digits, maximumFractionDigits: digits });
  }

  /** Formats a length: to centimetres below 100 m, to decimetres below 1 km. */
  length(metres: number): string {
    const size = Math.abs(metres);
    if (size >= 999.95) return `${this.#numbers(size >= 9_999.5 ? 1 : 2).format(metres / 1000)} km`;
    return `${this.#numbers(size >= 99.995 ? 1 : 2).format(metres)} m`;
  }

  /** Formats a height difference with an arrow; ± when it rounds to zero. */
  rise(metres: number): string {
    const arrow = Math.abs(metres) < 0.005 ? "± " : metres < 0 ? "↓ " : "↑ ";
    return arrow + this.length(Math.abs(metres));
  }

  /** Formats a height in the scene's CRS. */
  height(metres: number): string {
    return `${this.#numbers(Number.isInteger(metres) ? 0 : 1).format(metres)} m`;
  }

  /** Formats a range of heights. */
  range(low: number, high: number): string {
    return `${this.#numbers(2).format(low)} – ${this.#numbers(2).format(high)} m`;
  }

  /** Formats the distance and height of a profile sample. */
  formatSample(distance_m: number, height_m: number): string {
    return `${this.length(distance_m)}  ${Number.isNaN(height_m) ? this.#messages.hidden : `↕ ${this.#numbers(2).format(height_m)} m`}`;
  }

  get profile(): string {
    return this.#messages.profile;
  }

  get partHidden(): string {
    return this.#messages.partHidden;
  }

  get allHidden(): string {
    return this.#messages.allHidden;
  }

  /** Formats an area. */
  area(squareMetres: number): string {
    if (squareMetres >= 99_999.5) return `${this.#numbers(2).format(squareMetres / 10_000)} ha`;
    return `${this.#numbers(squareMetres >= 999.95 ? 0 : squareMetres >= 99.995 ? 1 : 2).format(squareMetres)} m²`;
  }
}
