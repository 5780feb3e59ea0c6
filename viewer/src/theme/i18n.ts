import { selectTranslation } from "../core/i18n";

interface ThemeMessages {
  readonly rest: string;
  readonly yes: string;
  readonly no: string;
}

const WORDS = {
  en: { rest: "Other", yes: "Yes", no: "No" },
  de: { rest: "Andere", yes: "Ja", no: "Nein" },
  fr: { rest: "Autres", yes: "Oui", no: "Non" },
};

export const getThemeMessages = (language: string): ThemeMessages => selectTranslation(WORDS, language);
