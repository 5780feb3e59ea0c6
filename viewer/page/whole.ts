import type { ClickEvent, ImageLayer } from "./map3d.module.js";

type Attributes = NonNullable<ClickEvent["attributes"]>;
/** An object with what is known of it. */
export type Described = Pick<ClickEvent, "id" | "name" | "class" | "attributes">;

/** Returns the attributes that another object lacks. */
const without = (attributes: Attributes = {}, other: Attributes): Attributes =>
  Object.fromEntries(Object.entries(attributes).filter(([name]) => !Object.hasOwn(other, name)));

/** Returns the outermost object that contains an object, such as the building of a part; attributes that only the part has are added. */
export async function findWhole<T extends Described>(layer: ImageLayer, part: T): Promise<T> {
  const above = new Set<number>([part.id]);
  let [whole, object] = [part, await layer.object(part.id)];
  if (object) whole = { ...whole, name: object.name, class: object.class, attributes: object.attributes };
  while (object && object.parent !== null && !above.has(object.parent)) {
    const id = object.parent;
    above.add(id);
    object = await layer.object(id);
    if (object)
      whole = {
        ...whole,
        id,
        name: object.name,
        class: object.class,
        attributes: { ...object.attributes, ...without(whole.attributes, object.attributes) },
      };
  }
  return whole;
}
