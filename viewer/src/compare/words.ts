import { inLanguage } from "../core/words";

interface Words {
  /** Of the line between two renderings. */
  readonly border: string;
  readonly time: string;
}

const KNOWN = {
  en: { border: "Border between the left and the right picture", time: "Time" },
  de: { border: "Grenze zwischen linkem und rechtem Bild", time: "Zeit" },
  fr: { border: "Limite entre l’image de gauche et celle de droite", time: "Époque" },
} satisfies Record<string, Words>;

export const wordsOf = (language: string): Words => inLanguage<Words>(KNOWN, language);
