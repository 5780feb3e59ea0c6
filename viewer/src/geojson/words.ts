import { inLanguage } from "../core/words";

interface Words {
  readonly features: string;
  readonly feature: (number: string) => string;
  readonly places: (count: string) => string;
}

const WORDS = {
  en: { features: "Features on the map", feature: (number: string) => `Feature ${number}`, places: (count: string) => `${count} places here` },
  de: { features: "Objekte auf der Karte", feature: (number: string) => `Objekt ${number}`, places: (count: string) => `${count} Orte hier` },
  fr: { features: "Objets sur la carte", feature: (number: string) => `Objet ${number}`, places: (count: string) => `${count} lieux ici` },
};

export const wordsIn = (language: string): Words => inLanguage(WORDS, language);
