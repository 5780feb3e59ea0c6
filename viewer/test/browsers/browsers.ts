import { existsSync } from "node:fs";
import type { Display } from "./display";
import type { Driver } from "./driver";
import { Firefox, FIREFOX } from "./firefox";
import { miniBrowser, WEBKIT_DRIVER, WebKit } from "./webkit";

/** A browser in which the tests run besides Chromium. */
export interface OtherBrowser {
  readonly name: string;
  /** It alters pixels that are read from a canvas, and reports a pixel ratio of 2. */
  readonly perturbs: boolean;
  readonly start: (display: Display) => Promise<Driver & { readonly complaints: readonly string[] }>;
  /** The missing requirement; null if it can run. */
  readonly missing: string | null;
}

const has = (...places: (string | undefined)[]): boolean => places.every((place) => place !== undefined && existsSync(place));
const xvfb = (process.env["PATH"] ?? "").split(":").some((folder) => existsSync(`${folder}/Xvfb`))
  ? null
  : "no Xvfb: apt-get install xvfb libgl1-mesa-dri libegl1";
const firefox = has(FIREFOX) ? xvfb : `no ${FIREFOX}: apt-get install firefox-esr, or name it in FIREFOX`;

export const OTHER_BROWSERS: readonly OtherBrowser[] = [
  { name: "Firefox", perturbs: false, start: (display) => Firefox.start(display), missing: firefox },
  {
    name: "Firefox that resists fingerprinting",
    perturbs: true,
    start: (display) => Firefox.start(display, { "privacy.resistFingerprinting": true }),
    missing: firefox,
  },
  {
    name: "WebKitGTK",
    perturbs: false,
    start: (display) => WebKit.start(display),
    missing: has(WEBKIT_DRIVER, miniBrowser()) ? xvfb : `no ${WEBKIT_DRIVER} and MiniBrowser: apt-get install webkit2gtk-driver`,
  },
];
