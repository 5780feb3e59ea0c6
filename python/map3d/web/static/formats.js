// Numbers, sizes and times as pages write them, in the language of the page: what page_formats.py does on the server.
"use strict";

const LOCALE = document.documentElement.lang || "en";
/** What separates a number from `s`, `min` and `h`. */
const SPACE = { de: "\u00a0", fr: "\u202f" }[LOCALE] ?? " ";

function numberText(value, options = {}) {
  return new Intl.NumberFormat(LOCALE, options).format(value);
}

/** Returns bytes with three digits: `512 bytes`, `1.40 GB`. */
function sizeText(bytes) {
  if (bytes < 999.5) return numberText(Math.round(bytes), { style: "unit", unit: "byte", unitDisplay: "long" });
  let value = bytes / 1000;
  for (const unit of ["kilobyte", "megabyte", "gigabyte"]) {
    if (value < 999.5) return unitText(value, unit, value >= 100 ? 0 : value >= 10 ? 1 : 2);
    value /= 1000;
  }
  return unitText(value, "terabyte", 2);
}

function unitText(value, unit, places) {
  return numberText(value, { style: "unit", unit, unitDisplay: "short", minimumFractionDigits: places, maximumFractionDigits: places });
}

/** Returns a time: `80 s`, `12 min`, `3.5 h`. */
function timeText(seconds) {
  if (seconds < 90) return `${numberText(Math.max(1, Math.round(seconds)))}${SPACE}s`;
  if (seconds < 5400) return `${numberText(Math.round(seconds / 60))}${SPACE}min`;
  return `${numberText(seconds / 3600, { minimumFractionDigits: 1, maximumFractionDigits: 1 })}${SPACE}h`;
}
