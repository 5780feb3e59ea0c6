"""Tables of routes: path, method, view function."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, TypeVar

from starlette.responses import Response

from map3d.catalogue import ROLES, Role
from map3d.web.http.access import SAFE_METHODS
from map3d.web.http.guards import GUARD, SIGN_IN, check_guarded

MOST_BYTES: Final = 64 << 10
"""Size of a body, unless the route says otherwise."""

View = TypeVar("View", bound=Callable[..., Response])


@dataclass(frozen=True)
class Rule:
    """`name`: that of the table and that of the view function. `view` gets the parameters of the path, and returns the response. `is_file`: it asks
    nothing but the server's own files, so it has threads that never wait for the catalogue."""

    name: str
    method: str
    path: str
    view: Callable[..., Response]
    most_bytes: int
    is_file: bool = False

    @property
    def reads_body(self) -> bool:
        return self.method not in SAFE_METHODS

    @property
    def role(self) -> Role | None:
        """The role that a caller needs before the body is read; None for the form that signs in."""
        guard: Role | str = getattr(self.view, GUARD, SIGN_IN)
        return next((role for role in ROLES if role == guard), None)

    @property
    def order(self) -> list[int]:
        """Rules of smaller order come first: plain parts of a path before parameters, those before parameters with slashes."""
        return [2 if ":path}" in part else "{" in part for part in self.path.split("/")]


class Routes:
    """The routes of a room. Parameters of a path are `{name}`, with slashes `{name:path}`."""

    def __init__(self, name: str, prefix: str = "") -> None:
        self._name, self._prefix = name, prefix
        self._rules: list[Rule] = []

    def __iter__(self) -> Iterator[Rule]:
        return iter(self._rules)

    def get(self, path: str, is_file: bool = False) -> Callable[[View], View]:
        return lambda view: self.add("GET", path, view, is_file=is_file)

    def post(self, path: str, most_bytes: int = MOST_BYTES) -> Callable[[View], View]:
        return lambda view: self.add("POST", path, view, most_bytes)

    def add(self, method: str, path: str, view: View, most_bytes: int = MOST_BYTES, is_file: bool = False) -> View:
        """Raises TypeError for a write without a guard."""
        check_guarded(path, view, method)
        self._rules.append(Rule(f"{self._name}.{view.__name__}", method, self._prefix + path, view, most_bytes, is_file))
        return view
