import { selectTranslation } from "../core/i18n";

export interface ControlMessages {
  readonly locate: string;
  readonly here: (accuracy: string) => string;
  readonly denied: string;
  readonly unavailable: string;
  readonly insecure: string;
  readonly outside: string;
  readonly notGeoreferenced: string;
  readonly overview: string;
  readonly move: string;
}

const EN: ControlMessages = {
  locate: "Show my location",
  here: (accuracy) => `You are here (± ${accuracy})`,
  denied: "Location access is blocked. Allow it in your browser’s settings for this page.",
  unavailable: "Your location is unavailable. Try again.",
  insecure: "Your location is only available on secure (https) pages.",
  outside: "Your location is outside this map.",
  notGeoreferenced: "Your location can’t be shown, because this map has no geographic coordinates.",
  overview: "Overview map",
  move: "Overview map: use the arrow keys to move the view",
};

const DE: ControlMessages = {
  locate: "Meinen Standort anzeigen",
  here: (accuracy) => `Sie sind hier (± ${accuracy})`,
  denied: "Der Zugriff auf Ihren Standort ist blockiert. Erlauben Sie ihn in den Browsereinstellungen für diese Seite.",
  unavailable: "Ihr Standort ist nicht verfügbar. Versuchen Sie es noch einmal.",
  insecure: "Ihr Standort ist nur auf sicheren Seiten (https) verfügbar.",
  outside: "Ihr Standort liegt außerhalb dieser Karte.",
  notGeoreferenced: "Ihr Standort kann nicht angezeigt werden, weil diese Karte keine geografischen Koordinaten hat.",
  overview: "Übersichtskarte",
  move: "Übersichtskarte: Ausschnitt mit den Pfeiltasten verschieben",
};

const FR: ControlMessages = {
  locate: "Afficher ma position",
  here: (accuracy) => `Vous êtes ici (± ${accuracy})`,
  denied: "L’accès à votre position est bloqué. Autorisez-le dans les réglages du navigateur pour cette page.",
  unavailable: "Votre position n’est pas disponible. Réessayez.",
  insecure: "Votre position n’est disponible que sur les pages sécurisées (https).",
  outside: "Votre position est en dehors de cette carte.",
  notGeoreferenced: "Votre position ne peut pas être affichée, car cette carte n’a pas de coordonnées géographiques.",
  overview: "Carte d’aperçu",
  move: "Carte d’aperçu\u00a0: utilisez les touches fléchées pour déplacer la vue",
};

export const getControlMessages = (language: string): ControlMessages => selectTranslation({ en: EN, de: DE, fr: FR }, language);
