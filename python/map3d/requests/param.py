"""Declares the fields of requests: what the command line, the REST API, the library and the forms of the web interface all say of them."""

from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, Final, Literal, get_args, get_type_hints

Front = Literal["cli", "rest", "library", "studio"]
FRONTS: Final[tuple[Front, ...]] = get_args(Front)
_PARAM: Final = "map3d.param"


@dataclass(frozen=True)
class Param:
    """`help`: a sentence; {other} stands for the name of the field `other`, as the front that shows it spells it. `default`: words for a default that
    is found out. `example`: as a person types the value. `minimum`, `maximum`: limits of a number, and lengths of a list. `is_size`: a number of
    bytes. `option`: name on the command line, if it is not --FIELD; `argument`: the command line takes it without a name. `rest`: name in the REST
    API, if it is not the field's. `label`: what a form writes beside the field. `lacks`: front → reason why it has no such field."""

    help: str
    default: str = ""
    example: str = ""
    choices: tuple[Any, ...] = ()
    minimum: Any = None
    maximum: Any = None
    pattern: str = ""
    is_size: bool = False
    option: str = ""
    argument: bool = False
    metavar: str = ""
    rest: str = ""
    label: str = ""
    lacks: Mapping[Front, str] = field(default_factory=dict)


@dataclass(frozen=True)
class RequestField:
    """A field of a request: `kind` is its type without None, `value` its default; without one, it is required."""

    name: str
    kind: Any
    param: Param
    value: Any
    required: bool

    @property
    def option(self) -> str:
        return self.param.option or f"--{self.name.replace('_', '-')}"

    @property
    def rest(self) -> str:
        return self.param.rest or self.name

    def is_on(self, front: Front) -> bool:
        return front not in self.param.lacks


def param(*default: Any, help: str, words: str = "", **more: Any) -> Any:
    """Declares a field of a request; without a `default`, it is required. `words` are the `Param.default`."""
    value = default[0] if default else MISSING
    return field(default=value, metadata={_PARAM: Param(help, words, **more)})


def fields_of(request: type) -> Mapping[str, RequestField]:
    """Returns the fields of a request by name: its own in the order of their declaration, then those of its bases."""
    kinds, known = get_type_hints(request), {one.name: one for one in fields(request)}
    names = dict.fromkeys(name for base in request.__mro__ for name in vars(base).get("__annotations__", {}))
    return {name: _field(known[name], kinds[name]) for name in names if name in known and _PARAM in known[name].metadata}


def help_text(request: type, name: str, front: Front) -> str:
    """Returns the help of a field, with the names that the front gives to other fields."""
    known = fields_of(request)
    names = {other: one.option.partition("/")[0] if front == "cli" else one.rest if front == "rest" else other for other, one in known.items()}
    text, example = known[name].param.help.format_map(names), known[name].param.example
    return f"{text.removesuffix('.')}, e.g. {example}." if front == "cli" and example else text


def _field(one: "Field[Any]", hint: Any) -> RequestField:
    kinds = [kind for kind in get_args(hint) if kind is not type(None)] if type(None) in get_args(hint) else [hint]
    return RequestField(one.name, kinds[0], one.metadata[_PARAM], None if one.default is MISSING else one.default, one.default is MISSING)
