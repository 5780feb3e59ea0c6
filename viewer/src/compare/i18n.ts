import { selectTranslation } from "../core/i18n";

interface CompareMessages {
  /** Accessible name of the swipe divider. */
  readonly divider: string;
  readonly time: string;
  readonly facing: (wind: string) => string;
  /** Counter-clockwise from north, in steps of 45°. */
  readonly headings: readonly string[];
}

const MESSAGES = {
  en: {
    divider: "Drag to compare",
    time: "Time",
    facing: (wind) => `Facing ${wind}`,
    headings: ["north", "north-west", "west", "south-west", "south", "south-east", "east", "north-east"],
  },
  de: {
    divider: "Zum Vergleichen ziehen",
    time: "Zeitpunkt",
    facing: (wind) => `Blick nach ${wind}`,
    headings: ["Norden", "Nordwesten", "Westen", "Südwesten", "Süden", "Südosten", "Osten", "Nordosten"],
  },
  fr: {
    divider: "Faites glisser pour comparer",
    time: "Époque",
    facing: (wind) => `Vue vers ${wind}`,
    headings: ["le nord", "le nord-ouest", "l’ouest", "le sud-ouest", "le sud", "le sud-est", "l’est", "le nord-est"],
  },
} satisfies Record<string, CompareMessages>;

export const getCompareMessages = (language: string): CompareMessages => selectTranslation<CompareMessages>(MESSAGES, language);

/** Describes a look-at angle in words. */
export function describeDirection(lookAt_deg: number, language: string): string {
  const { facing, headings } = getCompareMessages(language);
  return facing(headings[((Math.round(lookAt_deg / 45) % 8) + 8) % 8] ?? "");
}
