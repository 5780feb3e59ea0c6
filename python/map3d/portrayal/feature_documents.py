"""Feature information as XML, JSON and HTML (OGC 15-001r4 §11.7)."""

import json
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any
from xml.sax.saxutils import escape as escape_xml
from xml.sax.saxutils import quoteattr

from map3d.portrayal.feature_info import Feature
from map3d.registry import RegisteredObject

INFO_NAMESPACE = "http://www.opengis.net/3dps/1.0/info"


def feature_document(features: Sequence[Feature], media_type: str, id_only: bool) -> bytes:
    """Returns the document of a GetFeatureInfo answer. `id_only`: leaves out the attributes."""
    match media_type:
        case "application/json":
            return _json(features, id_only)
        case "text/html":
            return _html(features, id_only)
        case _:
            return _xml(features, id_only)


def attribute_groups(feature: Feature) -> list[Mapping[str, Any]]:
    """Returns the attributes of an object, and those of each object that it is part of."""
    groups = [_described(feature.object), *(_described(item) for item in feature.ancestors)]
    return [group for group in groups if group]


def _described(item: RegisteredObject) -> dict[str, Any]:
    level = {} if item.lod is None else {"lod": item.lod}
    return {"name": item.name, "class": item.kind, **level, **{key: value for key, value in item.attributes.items() if value is not None and key}}


def _xml(features: Sequence[Feature], id_only: bool) -> bytes:
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', f'<FeatureInfo xmlns="{INFO_NAMESPACE}">']
    for feature in features:
        lines.append(f"  <FeatureInfoList featureType={quoteattr(_clean(feature.object.kind))}>")
        lines.append(f"    <ObjectId>{feature.object_id}</ObjectId>")
        lines.append(f"    <FeatureId>{_escaped(feature.object.name)}</FeatureId>")
        lines.append(f"    <TypeName>{_escaped(feature.object.kind)}</TypeName>")
        for group in () if id_only else attribute_groups(feature):
            lines.append("    <FeatureAttributeList>")
            lines += [
                f"      <FeatureAttribute name={quoteattr(_clean(name))}>{_escaped(_text(value))}</FeatureAttribute>" for name, value in group.items()
            ]
            lines.append("    </FeatureAttributeList>")
        lines.append("  </FeatureInfoList>")
    lines.append("</FeatureInfo>\n")
    return "\n".join(lines).encode()


def _json(features: Sequence[Feature], id_only: bool) -> bytes:
    found = []
    for feature in features:
        entry: dict[str, Any] = {
            "objectId": feature.object_id,
            "featureId": feature.object.name,
            "typeName": feature.object.kind,
            "layer": feature.layer,
        }
        if not id_only:
            entry["featureAttributeLists"] = [dict(group) for group in attribute_groups(feature)]
        found.append(entry)
    return (json.dumps({"featureInfo": found}, ensure_ascii=False, indent=1) + "\n").encode()


def _html(features: Sequence[Feature], id_only: bool) -> bytes:
    """Returns one table per feature type, with one row per feature."""
    rows = [(feature, {} if id_only else _flat(feature)) for feature in features]
    tables = []
    for kind in dict.fromkeys(feature.object.kind for feature in features):
        of_kind = [(feature, values) for feature, values in rows if feature.object.kind == kind]
        names = list(dict.fromkeys(name for _, values in of_kind for name in values))
        head = "".join(f"<th>{escape(name)}</th>" for name in ["object id", "feature id", *names])
        lines = []
        for feature, values in of_kind:
            cells = [str(feature.object_id), feature.object.name, *(_text(values.get(name, "")) for name in names)]
            lines.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>")
        tables.append(f"<table><caption>{escape(kind)}</caption>\n<tr>{head}</tr>\n" + "\n".join(lines) + "\n</table>")
    style = (
        "body{font:14px system-ui,sans-serif;margin:1em}table{border-collapse:collapse}th,td{border:1px solid #bbb;padding:.3em .6em;text-align:left}"
    )
    page = f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Feature information</title><style>{style}</style></head>\n<body>\n'
    return (page + ("\n".join(tables) or "<p>No feature found.</p>") + "\n</body></html>\n").encode()


def _flat(feature: Feature) -> dict[str, Any]:
    """Returns all attributes in one row; those of the objects above keep their names unless the object itself has them."""
    values: dict[str, Any] = {}
    for group in attribute_groups(feature):
        values = {**group, **values}
    return {name: value for name, value in values.items() if name not in ("name", "class")}


def _text(value: Any) -> str:
    return ("true" if value else "false") if isinstance(value, bool) else str(value)


def _clean(text: str) -> str:
    """Replaces characters that XML cannot hold."""
    return "".join(
        character if character >= " " and not "\ud800" <= character <= "\udfff" and character not in "\ufffe\uffff" else " " for character in text
    )


def _escaped(text: str) -> str:
    return escape_xml(_clean(text))
