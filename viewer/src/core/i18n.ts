/** What the map says itself: names of controls, read aloud or shown. */
export interface MapMessages {
  readonly zoom: string;
  readonly zoomIn: string;
  readonly zoomOut: string;
  readonly direction: string;
  readonly left: string;
  readonly right: string;
  readonly north: string;
  readonly looking: (wind: string) => string;
  /** Counter-clockwise from north, by 45 degrees. */
  readonly winds: readonly string[];
  readonly screen: string;
  readonly fill: string;
  readonly leave: string;
  readonly scale: (length: string) => string;
  readonly details: string;
  readonly close: string;
}

const EN: MapMessages = {
  zoom: "Zoom",
  zoomIn: "Zoom in",
  zoomOut: "Zoom out",
  direction: "Direction",
  left: "Turn view counter-clockwise",
  right: "Turn view clockwise",
  north: "Look north",
  looking: (wind) => `Looking ${wind}; look north`,
  winds: ["north", "north-west", "west", "south-west", "south", "south-east", "east", "north-east"],
  screen: "Screen",
  fill: "Fill the screen",
  leave: "Leave the whole screen",
  scale: (length) => `Scale: ${length}`,
  details: "Details",
  close: "Close",
};

const DE: MapMessages = {
  zoom: "Zoom",
  zoomIn: "Vergrößern",
  zoomOut: "Verkleinern",
  direction: "Blickrichtung",
  left: "Ansicht gegen den Uhrzeigersinn drehen",
  right: "Ansicht im Uhrzeigersinn drehen",
  north: "Nach Norden blicken",
  looking: (wind) => `Blick nach ${wind}; nach Norden blicken`,
  winds: ["Norden", "Nordwesten", "Westen", "Südwesten", "Süden", "Südosten", "Osten", "Nordosten"],
  screen: "Bildschirm",
  fill: "Bildschirm füllen",
  leave: "Vollbild verlassen",
  scale: (length) => `Maßstab: ${length}`,
  details: "Einzelheiten",
  close: "Schließen",
};

const FR: MapMessages = {
  zoom: "Zoom",
  zoomIn: "Agrandir",
  zoomOut: "Réduire",
  direction: "Direction du regard",
  left: "Tourner la vue vers la gauche",
  right: "Tourner la vue vers la droite",
  north: "Regarder vers le nord",
  looking: (wind) => `Vue vers ${wind} ; regarder vers le nord`,
  winds: ["le nord", "le nord-ouest", "l’ouest", "le sud-ouest", "le sud", "le sud-est", "l’est", "le nord-est"],
  screen: "Écran",
  fill: "Plein écran",
  leave: "Quitter le plein écran",
  scale: (length) => `Échelle : ${length}`,
  details: "Détails",
  close: "Fermer",
};

/** The languages that are known. */
export interface Translations<T> {
  readonly en: T;
  readonly de: T;
  readonly fr: T;
}

/** English where a language (BCP 47) is not known. */
export const selectTranslation = <T>(known: Translations<T>, language: string): T => {
  const short = language.slice(0, 2).toLowerCase();
  return short === "de" || short === "fr" ? known[short] : known.en;
};

export const getMapMessages = (language: string): MapMessages => selectTranslation({ en: EN, de: DE, fr: FR }, language);

/** What the page around an element is written in, else what the browser's user reads. */
export const findLanguage = (element: Element): string => element.closest<HTMLElement>("[lang]:not([lang=''])")?.lang ?? navigator.language;
