import { selectTranslation } from "../core/i18n";

/** No rendering.json among the files, several, files that it names are missing, or a file cannot be read any more. */
export type FilesProblem = "none" | "several" | "missing" | "changed";

interface FilesMessages extends Record<FilesProblem, (paths: string) => string> {
  readonly open: string;
  readonly drop: string;
  readonly failed: string;
}

const EN: FilesMessages = {
  open: "Open a map folder from this device",
  drop: "Drop the folder of a published map here",
  failed: "This cannot be shown",
  none: () => "There is no rendering.json among these files. Take the whole folder of a published map.",
  several: (paths) => `There are several maps: ${paths}. Take one folder.`,
  missing: (paths) => `Files of this map are missing: ${paths}. Take the whole folder.`,
  changed: (paths) => `${paths} has changed or moved since it was opened. Open the folder again.`,
};

const DE: FilesMessages = {
  open: "Kartenordner von diesem Gerät öffnen",
  drop: "Den Ordner einer veröffentlichten Karte hier ablegen",
  failed: "Das kann nicht gezeigt werden",
  none: () => "Unter diesen Dateien ist keine rendering.json. Nehmen Sie den ganzen Ordner einer veröffentlichten Karte.",
  several: (paths) => `Das sind mehrere Karten: ${paths}. Nehmen Sie einen Ordner.`,
  missing: (paths) => `Dateien dieser Karte fehlen: ${paths}. Nehmen Sie den ganzen Ordner.`,
  changed: (paths) => `${paths} wurde seit dem Öffnen geändert oder verschoben. Öffnen Sie den Ordner noch einmal.`,
};

const FR: FilesMessages = {
  open: "Ouvrir un dossier de carte de cet appareil",
  drop: "Déposez ici le dossier d’une carte publiée",
  failed: "Ceci ne peut pas être montré",
  none: () => "Il n’y a pas de rendering.json parmi ces fichiers. Prenez le dossier entier d’une carte publiée.",
  several: (paths) => `Il y a plusieurs cartes : ${paths}. Prenez un seul dossier.`,
  missing: (paths) => `Des fichiers de cette carte manquent : ${paths}. Prenez le dossier entier.`,
  changed: (paths) => `${paths} a changé ou a été déplacé depuis son ouverture. Ouvrez le dossier à nouveau.`,
};

export const getFilesMessages = (language: string): FilesMessages => selectTranslation({ en: EN, de: DE, fr: FR }, language);
