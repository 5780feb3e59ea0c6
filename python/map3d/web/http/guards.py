"""Guards of view functions: who may ask for what. Reads are public unless a route says otherwise; every write needs the role `editor`."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Final, TypeVar

from map3d.accounts import Identity
from map3d.catalogue import Role
from map3d.web.http.access import CSRF_FIELD, CSRF_HEADER, SAFE_METHODS
from map3d.web.http.current import request

GUARD: Final = "map3d_guard"
"""Attribute of a guarded view function: the role that it requires, or SIGN_IN."""
SIGN_IN: Final = "sign-in"

View = TypeVar("View", bound=Callable[..., Any])


def requires(role: Role) -> Callable[[View], View]:
    """Guards a view function: only callers with the role or a higher one. For a write, the role is `editor`."""

    def guard(view: View) -> View:
        @wraps(view)
        def guarded(*arguments: Any, **named: Any) -> Any:
            require(role)
            return view(*arguments, **named)

        return mark(guarded, role)  # type: ignore[return-value]

    return guard


def mark(view: View, guard: str) -> View:
    setattr(view, GUARD, guard)
    return view


def require(role: Role) -> Identity:
    """Returns the identity of the current request's caller. Raises SignInRequired, Forbidden."""
    asked = request()
    return asked.site.access.check(asked.caller, role, asked["method"], sent_csrf() if asked.caller.session else None)


def sent_csrf() -> str | None:
    return request().headers.get(CSRF_HEADER) or request().form.get(CSRF_FIELD)


def check_guarded(path: str, view: Callable[..., Any], method: str) -> None:
    """Raises TypeError for a route that accepts writes by a view function without a guard."""
    if method not in SAFE_METHODS and not hasattr(view, GUARD):
        raise TypeError(f"route {path} accepts {method} without a guard; add @requires('editor') of map3d.web.http.guards")
