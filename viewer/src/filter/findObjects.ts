import { UsageError, type AttributeInfo, type AttributeValue, type ImageLayer } from "../map3d";
import { checkExpression, matches, type FilterExpression } from "./expression";

/** Attributes by name; an object's own attribute comes before a property of every object. */
async function findAttributes(layer: ImageLayer, names: ReadonlySet<string>): Promise<AttributeInfo[]> {
  if (!layer.rendering) await new Promise((ready) => layer.once("ready", ready));
  const all = await layer.attributes();
  return [...names].map((name) => {
    const info = all.find((each) => each.of === "attributes" && each.name === name) ?? all.find((each) => each.name === name);
    if (!info) throw new UsageError(`no attribute "${name}"; the rendering has ${all.map((each) => each.name).join(", ") || "none"}`);
    return info;
  });
}

/**
 * Finds the objects of a layer that fulfil an expression, among all that have any of its attributes. In a large rendering it reads the files of all values of
 * these attributes. Returns their ids. @param ids looks at these objects only, and reads only their files  @throws UsageError for an unknown attribute or a wrong expression
 */
export async function findObjects(layer: ImageLayer, expression: FilterExpression, ids?: readonly number[]): Promise<number[]> {
  const infos = await findAttributes(layer, checkExpression(expression));
  const columns = new Map<string, ReadonlyMap<number, AttributeValue>>(
    await Promise.all(infos.map(async (info) => [info.name, await layer.column(info, ids)] as const)),
  );
  const candidates = ids ?? new Set([...columns.values()].flatMap((column) => [...column.keys()]));
  return [...candidates].filter((id) => matches(expression, (name) => columns.get(name)?.get(id))).sort((a, b) => a - b);
}
