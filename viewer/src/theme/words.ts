import { inLanguage } from "../core/words";

interface ThemeWords {
  readonly rest: string;
  readonly yes: string;
  readonly no: string;
}

const WORDS = {
  en: { rest: "Other", yes: "Yes", no: "No" },
  de: { rest: "Andere", yes: "Ja", no: "Nein" },
  fr: { rest: "Autres", yes: "Oui", no: "Non" },
};

export const themeWords = (language: string): ThemeWords => inLanguage(WORDS, language);
