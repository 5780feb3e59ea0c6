import { selectTranslation } from "../core/i18n";

export interface ControlMessages {
  readonly locate: string;
  readonly here: (accuracy: string) => string;
  readonly denied: string;
  readonly unavailable: string;
  readonly insecure: string;
  readonly outside: string;
  readonly placeless: string;
  readonly overview: string;
  readonly move: string;
}

const EN: ControlMessages = {
  locate: "Show where I am",
  here: (accuracy) => `You are here, ± ${accuracy}`,
  denied: "Your browser does not tell where you are. Allow it in the settings of this page.",
  unavailable: "Your device does not know where it is just now. Try again.",
  insecure: "Browsers tell where you are on pages with https only.",
  outside: "You are outside of this map.",
  placeless: "It is not known where on earth this map lies.",
  overview: "Overview map",
  move: "Overview: arrow keys move the view",
};

const DE: ControlMessages = {
  locate: "Zeigen, wo ich bin",
  here: (accuracy) => `Sie sind hier, ± ${accuracy}`,
  denied: "Ihr Browser sagt nicht, wo Sie sind. Erlauben Sie es in den Einstellungen dieser Seite.",
  unavailable: "Ihr Gerät weiß gerade nicht, wo es ist. Versuchen Sie es noch einmal.",
  insecure: "Browser sagen nur auf Seiten mit https, wo Sie sind.",
  outside: "Sie sind außerhalb dieser Karte.",
  placeless: "Es ist nicht bekannt, wo auf der Erde diese Karte liegt.",
  overview: "Übersichtskarte",
  move: "Übersicht: Pfeiltasten bewegen den Ausschnitt",
};

const FR: ControlMessages = {
  locate: "Montrer où je suis",
  here: (accuracy) => `Vous êtes ici, ± ${accuracy}`,
  denied: "Votre navigateur ne dit pas où vous êtes. Permettez-le dans les réglages de cette page.",
  unavailable: "Votre appareil ne sait pas où il est pour l’instant. Réessayez.",
  insecure: "Les navigateurs ne disent où vous êtes que sur des pages en https.",
  outside: "Vous êtes en dehors de cette carte.",
  placeless: "On ne sait pas où cette carte se trouve sur terre.",
  overview: "Carte d’ensemble",
  move: "Vue d’ensemble : les flèches déplacent la vue",
};

export const getControlMessages = (language: string): ControlMessages => selectTranslation({ en: EN, de: DE, fr: FR }, language);
