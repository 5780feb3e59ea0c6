/** Texts of the map itself: names of controls, read aloud or shown. */
export interface MapMessages {
  readonly zoom: string;
  readonly zoomIn: string;
  readonly zoomOut: string;
  readonly direction: string;
  readonly rotateLeft: string;
  readonly rotateRight: string;
  readonly north: string;
  readonly facing: (wind: string) => string;
  /** Counter-clockwise from north, in steps of 45°. */
  readonly winds: readonly string[];
  readonly fullScreen: string;
  readonly enterFullScreen: string;
  readonly exitFullScreen: string;
  readonly scale: (length: string) => string;
  readonly details: string;
  readonly close: string;
  /** Shown while the page scrolls over the map. */
  readonly twoFingers: string;
  readonly wheelWithKey: (key: string) => string;
}

const EN: MapMessages = {
  zoom: "Zoom",
  zoomIn: "Zoom in",
  zoomOut: "Zoom out",
  direction: "Direction",
  rotateLeft: "Turn view counter-clockwise",
  rotateRight: "Turn view clockwise",
  north: "Reset to north",
  facing: (wind) => `Facing ${wind}; reset to north`,
  winds: ["north", "north-west", "west", "south-west", "south", "south-east", "east", "north-east"],
  fullScreen: "Full screen",
  enterFullScreen: "Enter full screen",
  exitFullScreen: "Exit full screen",
  scale: (length) => `Scale: ${length}`,
  details: "Details",
  close: "Close",
  twoFingers: "Use two fingers to move the map",
  wheelWithKey: (key) => `Use ${key} + scroll to zoom the map`,
};

const DE: MapMessages = {
  zoom: "Zoom",
  zoomIn: "Vergrößern",
  zoomOut: "Verkleinern",
  direction: "Blickrichtung",
  rotateLeft: "Ansicht gegen den Uhrzeigersinn drehen",
  rotateRight: "Ansicht im Uhrzeigersinn drehen",
  north: "Nach Norden ausrichten",
  facing: (wind) => `Blick nach ${wind}; nach Norden ausrichten`,
  winds: ["Norden", "Nordwesten", "Westen", "Südwesten", "Süden", "Südosten", "Osten", "Nordosten"],
  fullScreen: "Vollbild",
  enterFullScreen: "Vollbildmodus aktivieren",
  exitFullScreen: "Vollbildmodus beenden",
  scale: (length) => `Maßstab: ${length}`,
  details: "Details",
  close: "Schließen",
  twoFingers: "Karte mit zwei Fingern bewegen",
  wheelWithKey: (key) => `Karte mit ${key === "Ctrl" ? "Strg" : key} + Scrollen zoomen`,
};

const FR: MapMessages = {
  zoom: "Zoom",
  zoomIn: "Zoom avant",
  zoomOut: "Zoom arrière",
  direction: "Orientation",
  rotateLeft: "Faire pivoter la vue dans le sens antihoraire",
  rotateRight: "Faire pivoter la vue dans le sens horaire",
  north: "Orienter vers le nord",
  facing: (wind) => `Vue vers ${wind}. Orienter vers le nord`,
  winds: ["le nord", "le nord-ouest", "l’ouest", "le sud-ouest", "le sud", "le sud-est", "l’est", "le nord-est"],
  fullScreen: "Plein écran",
  enterFullScreen: "Passer en plein écran",
  exitFullScreen: "Quitter le plein écran",
  scale: (length) => `Échelle\u00a0: ${length}`,
  details: "Détails",
  close: "Fermer",
  twoFingers: "Déplacez la carte avec deux doigts",
  wheelWithKey: (key) => `${key} + défilement pour zoomer`,
};

/** One value for each supported language. */
export interface Translations<T> {
  readonly en: T;
  readonly de: T;
  readonly fr: T;
}

/** Returns the translation into a language (BCP 47); English for any other language. */
export const selectTranslation = <T>(translations: Translations<T>, language: string): T => {
  const short = language.slice(0, 2).toLowerCase();
  return short === "de" || short === "fr" ? translations[short] : translations.en;
};

export const getMapMessages = (language: string): MapMessages => selectTranslation({ en: EN, de: DE, fr: FR }, language);

/** Returns the language of the page around an element, or else the browser's. */
export const findLanguage = (element: Element): string => element.closest<HTMLElement>("[lang]:not([lang=''])")?.lang ?? navigator.language;
