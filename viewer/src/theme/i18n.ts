import { selectTranslation } from "../core/i18n";

interface ThemeMessages {
  readonly other: string;
  readonly yes: string;
  readonly no: string;
}

const TRANSLATIONS = {
  en: { other: "Other", yes: "Yes", no: "No" },
  de: { other: "Andere", yes: "Ja", no: "Nein" },
  fr: { other: "Autres", yes: "Oui", no: "Non" },
};

export const getThemeMessages = (language: string): ThemeMessages => selectTranslation(TRANSLATIONS, language);
