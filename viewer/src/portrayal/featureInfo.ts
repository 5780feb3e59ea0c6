import type { AttributeValue, ObjectInfo } from "../map3d";
import { attributeOf, childrenNamed, findBelow, textOf } from "./xml";

const MAX_ATTRIBUTES = 1000;

/**
 * Reads the object of a GetFeatureInfo document (OGC 15-001r4 §11.7); null when it has none. The attributes of an object come before those of the objects that it is
 * part of, which fill in what it lacks. All values are untrusted text.
 */
export function readFeatureInfo(root: Element): ObjectInfo | null {
  const feature = root.localName === "FeatureInfoList" ? root : findBelow(root, "FeatureInfoList");
  if (!feature) return null;
  const attributes = new Map<string, AttributeValue>();
  for (const list of childrenNamed(feature, "FeatureAttributeList")) {
    for (const element of childrenNamed(list, "FeatureAttribute")) {
      const name = attributeOf(element, "name");
      if (name && !attributes.has(name) && attributes.size < MAX_ATTRIBUTES) attributes.set(name, textOf(element, 10_000));
    }
  }
  const name = textOf(findBelow(feature, "FeatureId")) || String(attributes.get("name") ?? "");
  const kind = textOf(findBelow(feature, "TypeName")) || (attributeOf(feature, "featureType") ?? String(attributes.get("class") ?? ""));
  for (const [key, value] of [
    ["name", name],
    ["class", kind],
  ] as const)
    if (attributes.get(key) === value) attributes.delete(key);
  return { name, class: kind, parent: null, attributes: Object.fromEntries(attributes) };
}
