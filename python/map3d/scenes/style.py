"""Styles: colours of surfaces to which the files of a scene give none (spec/scene.md, Style)."""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

from map3d.catalogue import Catalogue
from map3d.errors import BadRequest
from map3d.requests.scenes import Style

STYLE: Final = "style"
SURFACES: Final = ("wall", "roof", "ground", "window", "door", "road", "water", "vegetation", "terrain", "other")
MAX_RULES: Final = 1_000
MAX_BYTES: Final = 1 << 20

_KEYS: Final = ("color", "surface", "class", "attributes")
_COLOR: Final = re.compile("#[0-9A-Fa-f]{6}")

Rules: TypeAlias = list[dict[str, Any]]
"""As a build takes them: a colour is a list of three bytes, an attribute's value a string."""


def read_style(path: Path) -> dict[str, Any]:
    """Reads and checks a style file. Raises BadRequest, with the number of the rule that is wrong."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise BadRequest(f"{path}: a style has at most {MAX_BYTES >> 20} MiB")
        value = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadRequest(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise BadRequest(f"{path}: not a JSON file in UTF-8: {error}") from error
    try:
        check_style(value)
    except BadRequest as error:
        raise BadRequest(f"{path}: {error}") from None
    return dict(value)


def check_style(value: Any) -> Rules:
    """Returns the rules of a style. Raises BadRequest."""
    rules = value.get("rules") if isinstance(value, Mapping) else None
    if not isinstance(rules, list) or set(value) != {"rules"}:
        raise BadRequest('a style is {"rules": [{"surface": "roof", "color": "#8a5a44"}, …]}')
    if len(rules) > MAX_RULES:
        raise BadRequest(f"{len(rules):,} rules, expected at most {MAX_RULES:,}")
    return [_rule(number, rule) for number, rule in enumerate(rules, 1)]


def choose_style(catalogue: Catalogue, scene: str, style: Style | None) -> None:
    """Sets the style of the next build of a scene; None leaves it as it is; without rules, colours are the built-in ones."""
    record = catalogue.scene(scene)
    rules = None if style is None else check_style(style)
    if rules is None or rules == record.options.get(STYLE, []):
        return
    options = {name: option for name, option in record.options.items() if name != STYLE}
    catalogue.set_scene_options(scene, {**options, STYLE: rules} if rules else options)


def _rule(number: int, rule: Any) -> dict[str, Any]:
    if not isinstance(rule, Mapping):
        raise BadRequest(f"rule {number}: expected an object")
    unknown = sorted(set(rule) - set(_KEYS))
    if unknown:
        raise BadRequest(f"rule {number}: unknown key {', '.join(unknown)}; known are {', '.join(_KEYS)}")
    out: dict[str, Any] = {"color": _color(number, rule.get("color"))}
    if "surface" in rule:
        out["surface"] = _one_of(number, "surface", rule["surface"], SURFACES)
    if "class" in rule:
        if not isinstance(rule["class"], str) or not rule["class"]:
            raise BadRequest(f"rule {number}: class is the class of an object, such as building")
        out["class"] = rule["class"]
    if "attributes" in rule:
        out["attributes"] = _attributes(number, rule["attributes"])
    return out


def _color(number: int, value: Any) -> list[int]:
    if not isinstance(value, str) or not _COLOR.fullmatch(value):
        raise BadRequest(f"rule {number}: color is {json.dumps(value)}, expected six hexadecimal digits after #, such as #8a5a44")
    return list(bytes.fromhex(value[1:]))


def _one_of(number: int, key: str, value: Any, known: Sequence[str]) -> str:
    if not isinstance(value, str) or value not in known:
        raise BadRequest(f"rule {number}: {key} is {json.dumps(value)}, expected one of {', '.join(known)}")
    return value


def _attributes(number: int, value: Any) -> dict[str, str]:
    if not isinstance(value, Mapping) or not value:
        raise BadRequest(f'rule {number}: attributes are names with values, such as {{"function": "school"}}')
    for name, wanted in value.items():
        if not isinstance(wanted, str | int | float):
            raise BadRequest(f"rule {number}: the value of {name} is {json.dumps(wanted)}, expected text, a number, true or false")
    return {name: wanted if isinstance(wanted, str) else json.dumps(wanted) for name, wanted in value.items()}
