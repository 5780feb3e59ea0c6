interface Words {
  readonly rest: string;
  readonly legend: string;
  readonly yes: string;
  readonly no: string;
}

const WORDS: Readonly<Record<string, Words>> = {
  en: { rest: "Other", legend: "Legend", yes: "Yes", no: "No" },
  de: { rest: "Andere", legend: "Legende", yes: "Ja", no: "Nein" },
  fr: { rest: "Autres", legend: "Légende", yes: "Oui", no: "Non" },
};

/** English where a language is not known. */
export const wordsOf = (language: string): Words => WORDS[language.slice(0, 2).toLowerCase()] ?? (WORDS["en"] as Words);
