import { selectTranslation } from "../core/i18n";

interface CompareMessages {
  /** Accessible name of the swipe divider. */
  readonly divider: string;
  readonly time: string;
}

const MESSAGES = {
  en: { divider: "Drag to compare", time: "Time" },
  de: { divider: "Zum Vergleichen ziehen", time: "Zeitpunkt" },
  fr: { divider: "Faites glisser pour comparer", time: "Époque" },
} satisfies Record<string, CompareMessages>;

export const getCompareMessages = (language: string): CompareMessages => selectTranslation<CompareMessages>(MESSAGES, language);
