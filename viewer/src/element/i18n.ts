import { selectTranslation } from "../core/i18n";

interface ElementMessages {
  readonly map: string;
  readonly failed: string;
}

const MESSAGES = {
  en: { map: "Map", failed: "Couldn’t load the map." },
  de: { map: "Karte", failed: "Die Karte konnte nicht geladen werden." },
  fr: { map: "Carte", failed: "Impossible de charger la carte." },
};

export const getElementMessages = (language: string): ElementMessages => selectTranslation(MESSAGES, language);
