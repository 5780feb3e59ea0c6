"""Parses key-value pairs of GET requests (OWS Common 2.0 §11.5, OGC 15-001r4 §10.7.1).

The grammar of PORTRAYALS uses `@ ; = ,`, which may also occur percent-encoded inside values. Hence the raw query is split first, and every token is
decoded once afterwards.
"""

from typing import Final
from urllib.parse import unquote

from map3d.portrayal.parameters import Parameters, PortrayalText
from map3d.portrayal.service_exception import invalid, quote

MAX_QUERY_BYTES: Final = 32_768
MAX_PAIRS: Final = 100
MAX_PORTRAYALS: Final = 16
MAX_ITEMS: Final = 64
PARTS: Final = ("width", "height", "projection", "imagelayers", "formats", "qualities")
_FORMAT_PARAMETERS: Final = ("mode=", "encoding=")


def parse_query(query: bytes) -> Parameters:
    """Raises InvalidParameterValue for a query that is too long, not UTF-8, or has a parameter twice."""
    if len(query) > MAX_QUERY_BYTES:
        raise invalid("query", f"{len(query)} bytes, the limit is {MAX_QUERY_BYTES}; send XML with POST instead")
    raw = _split_pairs(query.decode("latin-1"))
    portrayals = raw.pop("portrayals", None)
    values = {name: decode(value, name) for name, value in raw.items() if portrayals is None or name not in PARTS}
    return Parameters(values, None if portrayals is None else _parse_portrayals(_join_separate_keys(portrayals, raw)))


def decode(token: str, name: str) -> str:
    """Decodes a token once. Raises InvalidParameterValue unless it is UTF-8 without control characters."""
    try:
        text = unquote(token.encode("latin-1").decode(), errors="strict")
    except UnicodeDecodeError as error:
        raise invalid(name, "expected UTF-8") from error
    if any(character < " " or character == "\x7f" for character in text):
        raise invalid(name, "control characters are not allowed")
    return text


def _split_pairs(query: str) -> dict[str, str]:
    """Returns the raw values by lower-case name."""
    pairs = [pair for pair in query.split("&") if pair]
    if len(pairs) > MAX_PAIRS:
        raise invalid("query", f"{len(pairs)} parameters, the limit is {MAX_PAIRS}")
    found: dict[str, str] = {}
    for pair in pairs:
        name, _, value = pair.partition("=")
        key = decode(name, "query").lower()
        if key in found:
            raise invalid(key, "the parameter occurs twice")
        found[key] = value
    return found


def _join_separate_keys(portrayals: str, raw: dict[str, str]) -> str:
    """Returns the value of PORTRAYALS with the parts that the standard's own example writes as keys: `PORTRAYALS=WIDTH=9;HEIGHT=9;&PROJECTION=…`."""
    extra = [f"{name}={raw[name]}" for name in PARTS if name in raw]
    return ";".join([portrayals.strip().rstrip(";"), *extra]) if extra else portrayals


def _parse_portrayals(raw: str) -> tuple[PortrayalText, ...]:
    if _is_encoded_as_a_whole(raw):
        raw = decode(raw, "portrayals").encode().decode("latin-1")
    texts = raw.split("@")
    if len(texts) > MAX_PORTRAYALS:
        raise invalid("portrayals", f"{len(texts)} portrayals, the limit is {MAX_PORTRAYALS}")
    return tuple(_parse_portrayal(text) for text in texts)


def _is_encoded_as_a_whole(raw: str) -> bool:
    """Whether a client encoded the whole value, separators included, as URLSearchParams does."""
    lower = raw.lower()
    return ("%3d" in lower and "=" not in raw) or ("%3b" in lower and ";" not in raw)


def _parse_portrayal(text: str) -> PortrayalText:
    parts: dict[str, list[str]] = {}
    last = ""
    for token in text.split(";"):
        if not token.strip():
            continue
        name, equals, value = token.strip().partition("=")
        key = decode(name, "portrayals").strip().lower()
        if last == "formats" and equals and f"{key}=" in _FORMAT_PARAMETERS:  # `image/png;mode=32bit` with a bare semicolon
            parts[last][-1] += ";" + ",".join([f"{key}={decode(value.partition(',')[0], 'formats')}"])
            parts[last] += _items(value.partition(",")[2], last) if "," in value else []
            continue
        if not equals or key not in PARTS:
            raise invalid("portrayals", f"unexpected {quote(key)}; expected {'=…;'.join(part.upper() for part in PARTS)}=…")
        if key in parts:
            raise invalid("portrayals", f"{key.upper()} occurs twice")
        parts[key], last = _items(value, key), key
    return parts


def _items(value: str, name: str) -> list[str]:
    items = value.split(",")
    if len(items) > MAX_ITEMS:
        raise invalid("portrayals", f"{name.upper()} has {len(items)} items, the limit is {MAX_ITEMS}")
    found: list[str] = []
    for item in items:
        text = decode(item, "portrayals").strip()
        if name == "formats" and found and text.lower().startswith(_FORMAT_PARAMETERS):  # `mode=24bit,encoding=…` as in the standard's example
            found[-1] += f";{text}"
        else:
            found.append(text)
    return found
