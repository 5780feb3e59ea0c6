import { selectTranslation } from "../core/i18n";
import type { AreaMeasure, LineMeasure } from "./geometry";

type Rows = readonly (readonly [label: string, value: string])[];

const TRANSLATIONS = {
  en: {
    profile: "Elevation profile",
    partHidden: "partly hidden",
    allHidden: "entirely hidden",
    hidden: "hidden",
    length: "Length",
    level: "Horizontal",
    rise: "Height difference",
    area: "Area",
    slope: "Slope",
    perimeter: "Perimeter",
    elevation: "Elevation",
    offPlumb: "The points are not one above the other.",
    pastEdge: "A point fell past an edge, onto the surface behind it.",
  },
  de: {
    profile: "Höhenprofil",
    partHidden: "teilweise verdeckt",
    allHidden: "vollständig verdeckt",
    hidden: "verdeckt",
    length: "Länge",
    level: "Horizontal",
    rise: "Höhenunterschied",
    area: "Fläche",
    slope: "Neigung",
    perimeter: "Umfang",
    elevation: "Höhenlage",
    offPlumb: "Die Punkte liegen nicht übereinander.",
    pastEdge: "Ein Punkt liegt neben einer Kante, auf der Fläche dahinter.",
  },
  fr: {
    profile: "Profil altimétrique",
    partHidden: "en partie masqué",
    allHidden: "entièrement masqué",
    hidden: "masqué",
    length: "Longueur",
    level: "Horizontale",
    rise: "Dénivelé",
    area: "Surface",
    slope: "Pente",
    perimeter: "Périmètre",
    elevation: "Altitude",
    offPlumb: "Les points ne sont pas l’un au-dessus de l’autre.",
    pastEdge: "Un point est tombé à côté d’une arête, sur la surface derrière.",
  },
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

  /** Describes a line, or the height difference between its ends. @param prefix text before approximate values */
  describeLine({ length_m, horizontal_m, rise_m, steps_m }: LineMeasure, isHeight: boolean, prefix: string): Rows {
    const { length, level, rise } = this.#messages;
    const horizontal = [level, prefix + this.length(horizontal_m)] as const;
    const difference = [rise, prefix + this.rise(rise_m)] as const;
    return isHeight
      ? [difference, horizontal]
      : [[length, prefix + this.length(length_m)], ...(steps_m.length < 2 ? [horizontal] : []), difference];
  }

  /** Describes a polygon, or a face, which has no perimeter. */
  describeArea(
    { area_m2, slope_deg, perimeter_m }: Pick<AreaMeasure, "area_m2" | "slope_deg"> & Partial<AreaMeasure>,
    prefix: string,
  ): Rows {
    const { area, slope, perimeter } = this.#messages;
    return [
      [area, prefix + this.area(area_m2)],
      ...(perimeter_m === undefined ? [] : [[perimeter, prefix + this.length(perimeter_m)] as const]),
      [slope, `${slope_deg.toFixed(0)}°`],
    ];
  }

  /** Describes a profile by its horizontal length and its lowest and highest point. */
  describeProfile(length_m: number, heights_m: Float64Array, approximate: boolean): Rows {
    const known = [...heights_m].filter((height) => !Number.isNaN(height));
    const { level, elevation } = this.#messages;
    return [
      [level, (approximate ? "≈ " : "") + this.length(length_m)],
      [elevation, known.length > 0 ? this.range(Math.min(...known), Math.max(...known)) : this.#messages.allHidden],
    ];
  }

  get offPlumb(): string {
    return this.#messages.offPlumb;
  }

  get pastEdge(): string {
    return this.#messages.pastEdge;
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
