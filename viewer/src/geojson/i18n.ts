import { selectTranslation } from "../core/i18n";

interface GeojsonMessages {
  readonly features: string;
  readonly feature: (number: string) => string;
}

const MESSAGES = {
  en: { features: "Features on the map", feature: (number: string) => `Feature ${number}` },
  de: { features: "Objekte auf der Karte", feature: (number: string) => `Objekt ${number}` },
  fr: { features: "Objets sur la carte", feature: (number: string) => `Objet ${number}` },
};

export const getGeojsonMessages = (language: string): GeojsonMessages => selectTranslation(MESSAGES, language);
