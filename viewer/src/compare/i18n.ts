import { selectTranslation } from "../core/i18n";

interface CompareMessages {
  /** Of the line between two renderings. */
  readonly border: string;
  readonly time: string;
}

const KNOWN = {
  en: { border: "Border between the left and the right picture", time: "Time" },
  de: { border: "Grenze zwischen linkem und rechtem Bild", time: "Zeit" },
  fr: { border: "Limite entre l’image de gauche et celle de droite", time: "Époque" },
} satisfies Record<string, CompareMessages>;

export const getCompareMessages = (language: string): CompareMessages => selectTranslation<CompareMessages>(KNOWN, language);
