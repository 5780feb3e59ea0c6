import { selectTranslation } from "../core/i18n";

/** No rendering.json among the files, more than one, missing files, or a file that has changed since it was opened. */
export type FilesProblem = "none" | "several" | "missing" | "changed";

interface FilesMessages extends Record<FilesProblem, (paths: string) => string> {
  readonly open: string;
  readonly drop: string;
  readonly failed: string;
}

const EN: FilesMessages = {
  open: "Open map folder",
  drop: "Drop a map folder here to open it",
  failed: "Couldn’t open the map",
  none: () => "This is not a map folder: it has no rendering.json. Choose the complete folder of a published map.",
  several: (paths) => `This folder contains several maps: ${paths}. Choose the folder of one map.`,
  missing: (paths) => `Some files of this map are missing: ${paths}. Choose the complete folder.`,
  changed: (paths) => `The file ${paths} has changed or moved. Open the folder again.`,
};

const DE: FilesMessages = {
  open: "Kartenordner öffnen",
  drop: "Kartenordner zum Öffnen hier ablegen",
  failed: "Die Karte konnte nicht geöffnet werden",
  none: () =>
    "Das ist kein Kartenordner: Die Datei rendering.json fehlt. Wählen Sie den vollständigen Ordner einer veröffentlichten Karte.",
  several: (paths) => `Dieser Ordner enthält mehrere Karten: ${paths}. Wählen Sie den Ordner einer einzelnen Karte.`,
  missing: (paths) => `Dateien dieser Karte fehlen: ${paths}. Wählen Sie den vollständigen Ordner.`,
  changed: (paths) => `Die Datei ${paths} wurde geändert oder verschoben. Öffnen Sie den Ordner noch einmal.`,
};

const FR: FilesMessages = {
  open: "Ouvrir un dossier de carte",
  drop: "Déposez un dossier de carte ici pour l’ouvrir",
  failed: "Impossible d’ouvrir la carte",
  none: () =>
    "Ce n’est pas un dossier de carte\u00a0: le fichier rendering.json manque. Choisissez le dossier complet d’une carte publiée.",
  several: (paths) => `Ce dossier contient plusieurs cartes\u00a0: ${paths}. Choisissez le dossier d’une seule carte.`,
  missing: (paths) => `Des fichiers de cette carte manquent\u00a0: ${paths}. Choisissez le dossier complet.`,
  changed: (paths) => `Le fichier ${paths} a été modifié ou déplacé. Ouvrez de nouveau le dossier.`,
};

export const getFilesMessages = (language: string): FilesMessages => selectTranslation({ en: EN, de: DE, fr: FR }, language);
