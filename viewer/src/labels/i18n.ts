import { selectTranslation } from "../core/i18n";

/** Name of the button that shows and hides the labels. */
export const getLabelsMessage = (language: string): string =>
  selectTranslation({ en: "Names on the map", de: "Namen auf der Karte", fr: "Noms sur la carte" }, language);
