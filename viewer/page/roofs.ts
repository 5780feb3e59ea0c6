import { language } from "./i18n";

/** Types of roofs of the SIG3D list (CityGML 2.0, annex C.1), in German and French. */
const ROOFS: Readonly<Record<string, readonly [de: string, fr: string]>> = {
  "flat roof": ["Flachdach", "toit plat"],
  "monopitch roof": ["Pultdach", "toit à un versant"],
  "skip pent roof": ["versetztes Pultdach", "toit à versants décalés"],
  "gabled roof": ["Satteldach", "toit à deux versants"],
  "hipped roof": ["Walmdach", "toit à quatre versants"],
  "half-hipped roof": ["Krüppelwalmdach", "toit à demi-croupe"],
  "mansard roof": ["Mansarddach", "toit à la Mansart"],
  "pavilion roof": ["Zeltdach", "toit en pavillon"],
  "cone roof": ["Kegeldach", "toit conique"],
  "copula roof": ["Kuppeldach", "coupole"],
  "sawtooth roof": ["Sheddach", "toit en dents de scie"],
  "arch roof": ["Bogendach", "toit en berceau"],
  "pyramidal broach roof": ["Turmdach", "flèche"],
  "combination of roof forms": ["Mischform", "formes combinées"],
};

/** Returns the type of a roof in a language; any other text as it is. */
export function roofInWords(type: string, locale = language): string {
  const index = ["de", "fr"].indexOf(locale.slice(0, 2).toLowerCase());
  return ROOFS[type]?.[index] ?? type;
}
