const EN = {
  incomplete: "This rendering is not complete yet.",
  saving: "Data saver is on: fewer details.",
  search: "Search",
  searchFor: "Search for a name or an address",
  results: "Results",
  nothingFound: "Nothing found",
  noIndex: "The search index cannot be read",
  tools: "Tools",
  measureLine: "Measure a line",
  measureArea: "Measure an area",
  lineHint: "Click along what you measure.",
  measureProfile: "Heights along a line",
  profileHint: "Click where the line begins and ends.",
  areaHint: "Click a roof or a wall, or one corner after another.",
  noTool: "The tool cannot be loaded",
  picture: "Picture and print",
  size: "Size",
  screen: "Screen",
  cancel: "Cancel",
  print: "Print",
  save: "Save as PNG",
  making: "Making the picture",
  noPicture: "The picture cannot be made",
  crs: "Coordinates",
  look: "Light and layers",
  time: "Time of day of the light",
  more: "Day and colours",
  day: "Day of the light",
  shadows: "Shadows",
  colorBy: "Colour by",
  noColors: "Colours cannot be loaded",
  class: "Class",
  asset: "Source",
  modes: "What is shown",
  lit: "Lit",
  color: "Colour",
  normal: "Normals",
  id: "Ids",
  depth: "Depth",
  chosen: "Chosen object",
  object: "Object",
  point: "A point",
  approximate: "approximate",
  position: "Position",
  height: "Height",
  listSeen: "List what is in view",
  inView: "In view",
  yes: "yes",
  no: "no",
  close: "Close",
  notShown: "This rendering cannot be shown",
  notStarted: "This page cannot start",
};

type Words = typeof EN;

const DE: Words = {
  incomplete: "Diese Darstellung ist noch nicht vollständig.",
  saving: "Datensparen ist an: weniger Einzelheiten.",
  search: "Suchen",
  searchFor: "Namen oder Adresse suchen",
  results: "Treffer",
  nothingFound: "Nichts gefunden",
  noIndex: "Das Suchverzeichnis kann nicht gelesen werden",
  tools: "Werkzeuge",
  measureLine: "Strecke messen",
  measureArea: "Fläche messen",
  lineHint: "Klicken Sie entlang dem, was Sie messen.",
  measureProfile: "Höhen entlang einer Linie",
  profileHint: "Klicken Sie, wo die Linie beginnt und endet.",
  areaHint: "Klicken Sie auf ein Dach oder eine Wand, oder auf Ecke um Ecke.",
  noTool: "Das Werkzeug kann nicht geladen werden",
  picture: "Bild und Druck",
  size: "Größe",
  screen: "Bildschirm",
  cancel: "Abbrechen",
  print: "Drucken",
  save: "Als PNG sichern",
  making: "Das Bild entsteht",
  noPicture: "Das Bild kann nicht entstehen",
  crs: "Koordinaten",
  look: "Licht und Ebenen",
  time: "Tageszeit des Lichts",
  more: "Tag und Farben",
  day: "Tag des Lichts",
  shadows: "Schatten",
  colorBy: "Farbe nach",
  noColors: "Die Farben können nicht geladen werden",
  class: "Klasse",
  asset: "Quelle",
  modes: "Was gezeigt wird",
  lit: "Licht",
  color: "Farbe",
  normal: "Normalen",
  id: "Ids",
  depth: "Tiefe",
  chosen: "Gewähltes Objekt",
  object: "Objekt",
  point: "Ein Punkt",
  approximate: "ungefähr",
  position: "Lage",
  height: "Höhe",
  listSeen: "Auflisten, was zu sehen ist",
  inView: "Zu sehen",
  yes: "ja",
  no: "nein",
  close: "Schließen",
  notShown: "Diese Darstellung kann nicht gezeigt werden",
  notStarted: "Diese Seite kann nicht starten",
};

const FR: Words = {
  incomplete: "Ce rendu n’est pas encore complet.",
  saving: "Économie de données : moins de détails.",
  search: "Rechercher",
  searchFor: "Rechercher un nom ou une adresse",
  results: "Résultats",
  nothingFound: "Aucun résultat",
  noIndex: "L’index de recherche ne peut pas être lu",
  tools: "Outils",
  measureLine: "Mesurer une ligne",
  measureArea: "Mesurer une surface",
  lineHint: "Cliquez le long de ce que vous mesurez.",
  measureProfile: "Hauteurs le long d’une ligne",
  profileHint: "Cliquez où la ligne commence et finit.",
  areaHint: "Cliquez sur un toit ou un mur, ou d’un coin à l’autre.",
  noTool: "L’outil ne peut pas être chargé",
  picture: "Image et impression",
  size: "Taille",
  screen: "Écran",
  cancel: "Annuler",
  print: "Imprimer",
  save: "Enregistrer en PNG",
  making: "L’image se prépare",
  noPicture: "L’image ne peut pas être faite",
  crs: "Coordonnées",
  look: "Lumière et couches",
  time: "Heure de la lumière",
  more: "Jour et couleurs",
  day: "Jour de la lumière",
  shadows: "Ombres",
  colorBy: "Couleur selon",
  noColors: "Les couleurs ne peuvent pas être chargées",
  class: "Classe",
  asset: "Source",
  modes: "Ce qui est montré",
  lit: "Lumière",
  color: "Couleur",
  normal: "Normales",
  id: "Ids",
  depth: "Prof.",
  chosen: "Objet choisi",
  object: "Objet",
  point: "Un point",
  approximate: "approximatif",
  position: "Position",
  height: "Altitude",
  listSeen: "Lister ce qui est visible",
  inView: "Visible",
  yes: "oui",
  no: "non",
  close: "Fermer",
  notShown: "Ce rendu ne peut pas être montré",
  notStarted: "Cette page ne peut pas démarrer",
};

const KNOWN: Readonly<Record<string, Words>> = { en: EN, de: DE, fr: FR };

/** The first of the reader's languages that is known here, else English. */
export function chooseLanguage(wanted: readonly string[]): string {
  return wanted.find((language) => language.slice(0, 2).toLowerCase() in KNOWN) ?? "en";
}

export const language = chooseLanguage(typeof navigator === "undefined" ? [] : navigator.languages);
const words = KNOWN[language.slice(0, 2).toLowerCase()] ?? EN;

/** The keys of all words. */
export const KEYS: ReadonlySet<string> = new Set(Object.keys(EN));

export const say = (what: keyof Words): string => words[what];

/** Puts the page's own words into the reader's language: `data-say` is for text, `data-say-label` for names that are read aloud and `data-say-hint` for what stands in an empty field. */
export function translate(page: ParentNode = document): void {
  document.documentElement.lang = language;
  const each = (name: string, act: (element: HTMLElement, text: string) => void): void => {
    for (const element of page.querySelectorAll<HTMLElement>(`[data-${name}]`)) act(element, say(element.getAttribute(`data-${name}`) as keyof Words));
  };
  each("say", (element, text) => { element.textContent = text; });
  each("say-label", (element, text) => {
    element.setAttribute("aria-label", text);
    if (element.title !== "") element.title = text;
  });
  each("say-hint", (element, text) => { element.setAttribute("placeholder", text); });
}
