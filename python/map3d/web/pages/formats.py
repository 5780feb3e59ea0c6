"""Numbers, sizes, lengths and times as pages write them: in the language of the page."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from map3d import number_formats
from map3d.web.pages.language import language


def _in_page_language(write: Callable[..., str]) -> Callable[..., str]:
    return lambda *values: write(*values, language())


FILTERS: Final[Mapping[str, Callable[..., str]]] = {
    name: _in_page_language(getattr(number_formats, name))
    for name in ("size", "duration", "number", "decimal", "percent", "metres", "distance", "date", "moment")
}
size, duration, number, decimal, distance = (FILTERS[name] for name in ("size", "duration", "number", "decimal", "distance"))


def number_or_text(value: Any) -> Any:
    return number(value) if isinstance(value, int | float) else value
