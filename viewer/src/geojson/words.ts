import { inLanguage } from "../core/words";

interface Words {
  readonly features: string;
  readonly feature: (number: string) => string;
}

const WORDS = {
  en: { features: "Features on the map", feature: (number: string) => `Feature ${number}` },
  de: { features: "Objekte auf der Karte", feature: (number: string) => `Objekt ${number}` },
  fr: { features: "Objets sur la carte", feature: (number: string) => `Objet ${number}` },
};

export const wordsIn = (language: string): Words => inLanguage(WORDS, language);
