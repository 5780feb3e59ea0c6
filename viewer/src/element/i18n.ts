import { selectTranslation } from "../core/i18n";

interface ElementMessages {
  readonly map: string;
  readonly failed: string;
}

const WORDS = {
  en: { map: "Map", failed: "The map cannot be shown." },
  de: { map: "Karte", failed: "Die Karte kann nicht gezeigt werden." },
  fr: { map: "Carte", failed: "La carte ne peut pas être affichée." },
};

export const getElementMessages = (language: string): ElementMessages => selectTranslation(WORDS, language);
