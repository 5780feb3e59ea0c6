"""Parses XML bodies of POST requests into the same parameters as key-value pairs.

The standard's example and the published schemas differ (docs/portrayal-service.md); both are accepted, because elements are known by their local
names. Document type declarations, and with them all entities and external references, are refused.
"""

from typing import Any, Final
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from map3d.portrayal.kvp import MAX_PORTRAYALS
from map3d.portrayal.parameters import Parameters, PortrayalText
from map3d.portrayal.projections import PROJECTIONS
from map3d.portrayal.service_exception import ServiceException, invalid, quote

MAX_BODY_BYTES: Final = 65_536
MAX_DEPTH: Final = 32
OPERATIONS: Final = (
    "GetCapabilities",
    "GetView",
    "GetFeatureInfoByRay",
    "GetFeatureInfoByPosition",
    "GetFeatureInfoByObjectId",
    "GetResourceById",
)
_ITEM_NAMES: Final = ("identifier", "format", "version", "section", "language", "outputformat", "value")
_PORTRAYAL_LISTS: Final = ("imagelayers", "formats", "qualities")


def parse_body(body: bytes) -> Parameters:
    """Raises InvalidParameterValue for a body that is not such a document, OperationNotSupported for another root element."""
    if len(body) > MAX_BODY_BYTES:
        raise invalid("request", f"the body has {len(body)} bytes, the limit is {MAX_BODY_BYTES}")
    root = parse_document(body)
    name = _local_name(root)
    if name not in OPERATIONS:
        raise ServiceException("OperationNotSupported", f"no operation {quote(name)}; expected {', '.join(OPERATIONS)}", name)
    values = {key.lower(): value for key, value in root.attrib.items() if "}" not in key}
    values.setdefault("service", "3DPS" if name == "GetCapabilities" else "")
    values["request"] = name
    portrayals = None
    for child in root:
        key = _local_name(child).lower()
        if key == "portrayals":
            portrayals = _parse_portrayals(child)
        elif key == "boundingbox":
            values[key] = _bounding_box_text(child)
        elif key.endswith("projection"):
            values["projection"] = ",".join(_projection_items(child))
        else:
            text = ",".join(_items(child))
            values[key] = f"{values[key]},{text}" if key in values else text  # `ObjectId` and `DeliveryOptions` may repeat
    return Parameters(values, portrayals)


def parse_document(body: bytes) -> Element:
    """Returns the root element of a document without a document type declaration. Raises InvalidParameterValue."""
    builder = TreeBuilder()
    parser = expat.ParserCreate(namespace_separator="}")
    depth = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise invalid("request", f"elements are nested deeper than {MAX_DEPTH}")
        builder.start(name, attributes)

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(name)

    def refuse(*_: Any) -> int:
        raise invalid("request", "document type declarations and entities are not allowed")

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, builder.data
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(body, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise invalid("request", f"not well-formed XML: {error}") from error
    root = builder.close()
    assert isinstance(root, Element), "a well-formed document has a root element"
    return root


def _local_name(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _text(element: Element) -> str:
    return (element.text or "").strip()


def _items(element: Element) -> list[str]:
    """Returns the items of a list, written as elements or as comma-separated text; of a position also as X1, X2, X3 or separated by blanks."""
    children = [child for child in element if _local_name(child).lower() in (*_ITEM_NAMES, "x1", "x2", "x3")]
    if children:
        return [_text(child) for child in children]
    text = _text(element)
    return (
        text.split() if _local_name(element).lower() in ("coordinate", "imageposition", "poc", "poi", "up") and "," not in text else text.split(",")
    )


def _bounding_box_text(element: Element) -> str:
    """Returns the box as key-value pairs write it."""
    corners = {_local_name(child).lower(): _text(child).split() for child in element}
    numbers = [*corners.get("lowercorner", []), *corners.get("uppercorner", [])]
    crs = element.attrib.get("crs")
    return ",".join([*numbers, crs] if crs else numbers)


def _projection_items(element: Element) -> list[str]:
    """Returns the identifier and the values of a projection in the order of the capabilities; missing values are empty."""
    found = {_local_name(child).lower(): child for child in element}
    named = next((_text(found[key]) for key in ("identifier", "typename") if key in found), _local_name(element).removesuffix("Projection"))
    projection = PROJECTIONS.get(named)
    if projection is None:
        raise invalid("portrayals", f"no projection {quote(named)}; expected {' or '.join(PROJECTIONS)}")
    values = [named]
    for group, names in projection.groups():
        if group.lower() in found:
            items = _items(found[group.lower()])
            if len(items) != len(names):
                raise invalid("portrayals", f"{group} has {len(items)} numbers, expected {len(names)}")
            values += items
        else:
            values += [""] * len(names)
    return values


def _parse_portrayals(element: Element) -> tuple[PortrayalText, ...]:
    portrayals = tuple(_parse_portrayal(child) for child in element if _local_name(child) == "Portrayal")
    if len(portrayals) > MAX_PORTRAYALS:
        raise invalid("portrayals", f"{len(portrayals)} portrayals, the limit is {MAX_PORTRAYALS}")
    return portrayals


def _parse_portrayal(element: Element) -> PortrayalText:
    parts: dict[str, list[str]] = {}
    for child in element:
        key = _local_name(child).lower()
        if key in parts:
            raise invalid("portrayals", f"{quote(key)} occurs twice")
        if key.endswith("projection"):
            parts["projection"] = _projection_items(child)
        elif key in _PORTRAYAL_LISTS:
            parts[key] = [item.strip() for item in _items(child)]
        elif key in ("width", "height"):
            parts[key] = [_text(child)]
        else:
            raise invalid("portrayals", f"unexpected element {quote(key)}")
    return parts
