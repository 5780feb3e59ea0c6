import type { Attribute, ClickEvent } from "./map3d.module.js";
import type { Described } from "./whole";
import { language, message, type MessageKey } from "./i18n";
import { roofInWords } from "./roofs";

type Row = readonly [name: string, value: string];

/** What a card says of an object, or of a point on the ground. */
export interface Card {
  readonly title: string;
  /** Kind, and address unless it is the title. */
  readonly note: string;
  /** What most people want to know, in words. */
  readonly rows: readonly Row[];
  /** Ids, coordinates and attributes as the data names them. */
  readonly details: readonly Row[];
}

/** The coordinate systems of positions. */
export interface Units {
  readonly crs: string;
  readonly vertical: string | null;
}

/** Years and numbers of houses have no separators of thousands. */
const PLAIN = { useGrouping: false, maximumFractionDigits: 12 } as const;
const CLASSES: Readonly<Record<string, MessageKey>> = {
  building: "building",
  building_part: "buildingPart",
  terrain: "terrain",
  ground: "terrain",
  tinrelief: "terrain",
  solitary_vegetation_object: "tree",
  plant_cover: "vegetation",
  vegetation: "vegetation",
  water_body: "water",
  road: "road",
  bridge: "bridge",
  tunnel: "tunnel",
  city_furniture: "furniture",
  land_use: "landUse",
};

/** Classes of the ground, which is not marked and not listed. */
export const NOT_HIGHLIGHTED: ReadonlySet<string> = new Set(["terrain", "ground", "tinrelief"]);

/** Returns what a class is called; "" for a code. */
export function kindOf(type: string): string {
  const known = CLASSES[type];
  return known ? message(known) : isWords(type) ? type.replaceAll("_", " ") : "";
}

const format = (value: number, digits?: number): string =>
  value.toLocaleString(language, digits === undefined ? PLAIN : { ...PLAIN, minimumFractionDigits: digits, maximumFractionDigits: digits });
const isNumber = (value: Attribute | undefined): value is number => typeof value === "number" && Number.isFinite(value) && value > -999;
/** Text that is not a code. */
const isWords = (value: Attribute | undefined): value is string => typeof value === "string" && /\p{L}{3}/u.test(value);
/** An id of the data, such as a gml:id: one word with several digits in a row, or with an underscore. */
const isId = (name: string): boolean => /^\S*(?:\d{3}|_)\S*$/.test(name);

/** Returns what a search result is called: its label, which is a class if there is nothing better. Older indexes have identifiers in labels. */
export function nameOfResult(label: string): string {
  const known = CLASSES[label];
  if (known) return message(known);
  return label.replace(/^\S*(?:\d{3}|_)\S*(?:, |$)/, "") || (/\d/.test(label) ? message("object") : label.replaceAll("_", " "));
}

/** After the name of a measure: the attribute with its unit, where that is not metres. */
const UNIT = "/unit";
const unitOf = (attributes: Readonly<Record<string, Attribute>>, key: string): string => {
  const unit = attributes[`${key}${UNIT}`];
  return typeof unit === "string" ? unit : "";
};

/** Lists what the card says of an object's use, age, size and roof, besides its title. */
function listFacts(attributes: Readonly<Record<string, Attribute>>, title: string): Row[] {
  const text = (key: string): string => (isWords(attributes[key]) ? attributes[key] : "");
  const number = (key: string): string => (isNumber(attributes[key]) ? format(attributes[key]) : "");
  const height = number("measuredHeight");
  const unit = unitOf(attributes, "measuredHeight") || "m";
  const year = number("yearOfConstruction");
  const rows: [MessageKey, string][] = [
    ["use", [text("function"), text("usage")].find((each) => each !== "" && each !== title) ?? ""],
    ["built", title.endsWith(year) ? "" : year],
    ["measuredHeight", height && `${height} ${unit}`],
    ["storeys", number("storeysAboveGround")],
    ["roof", roofInWords(text("roofType"))],
  ];
  return rows.filter(([, value]) => value !== "").map(([key, value]) => [message(key), value]);
}

/** Lists attributes as the data names them, measures with their unit. */
function listAttributes(attributes: Readonly<Record<string, Attribute>>): Row[] {
  return Object.entries(attributes)
    .filter(([key]) => !key.endsWith(UNIT) || attributes[key.slice(0, -UNIT.length)] === undefined)
    .map(([key, value]): Row => [
      key,
      typeof value === "number" ? `${format(value)} ${unitOf(attributes, key)}`.trim() : formatValue(value),
    ])
    .filter(([, value]) => value !== "");
}

/** Describes a picked object. @param lonLat of its position, where known */
export function describe(
  {
    id,
    name,
    class: type = "",
    attributes = {},
    position = null,
    approximate = false,
  }: Described & Partial<Pick<ClickEvent, "position" | "approximate">>,
  units: Units = { crs: "", vertical: null },
  lonLat: readonly [number, number] | null = null,
): Card {
  const text = (key: string): string => (isWords(attributes[key]) ? attributes[key] : "");
  const year = attributes["yearOfConstruction"];
  const kind = kindOf(type);
  const proper = [text("name"), name ?? ""].find((each) => each !== "" && !isId(each));
  const address = text("address");
  const titles = [proper ?? "", address, [text("function") || kind, isNumber(year) ? format(year) : ""].filter(Boolean).join(", ")];
  const isGround = id === 0 || NOT_HIGHLIGHTED.has(type);
  const title = id > 0 && isGround ? kind : id > 0 ? (titles.find(Boolean) ?? `${message("object")} ${String(id)}`) : message("point");
  const rows = listFacts(attributes, title);
  if (position) rows.push([message("height"), `${format(position[2], 2)} m${units.vertical ? ` (${units.vertical})` : ""}`]);
  const separator = format(0.5).includes(",") ? "; " : ", ";
  if (lonLat)
    rows.push([
      message("coordinates"),
      lonLat
        .map((part) => `${format(part, 5)}°`)
        .reverse()
        .join(separator),
    ]);
  const place: Row[] = position
    ? [
        [
          message("position"),
          position
            .slice(0, 2)
            .map((part) => format(part, 2))
            .join(separator),
        ],
      ]
    : [];
  if (isGround) rows.push(...place);
  const details: Row[] = [
    ...(isGround ? [] : place),
    ...(id > 0 ? [["id", String(id)] as const] : []),
    ...(name !== undefined && name !== title ? [["gml:id", name] as const] : []),
    ...listAttributes(attributes),
  ];
  return {
    title,
    note: [title === kind ? "" : kind, title === address ? "" : address, approximate ? message("approximate") : ""]
      .filter(Boolean)
      .join(" · "),
    rows,
    details,
  };
}

function formatValue(value: string | boolean | null): string {
  if (value === null) return "–";
  return typeof value === "boolean" ? message(value ? "yes" : "no") : value;
}
