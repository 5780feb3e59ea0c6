"""Guards of routes: who may ask for what. Reads are public unless a route says otherwise; every write needs the role `editor`.

A browser proves who it is with a signed session cookie, and sends with each form the value that only pages of this server contain. A program sends
`Authorization: Bearer TOKEN`.
"""

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import wraps
from typing import Any, Final, TypeVar

from flask import current_app, g, request

from map3d.accounts import Accounts, Identity, Session, Sessions, SignInLimits
from map3d.catalogue import Catalogue, Role, Workspace
from map3d.errors import Forbidden, SignInRequired

ACCESS: Final = "map3d.access"
"""Name of the AccessControl among the extensions of the Flask app."""
COOKIE: Final = "map3d_session"
CSRF_FIELD: Final = "csrf"
CSRF_HEADER: Final = "X-CSRF-Token"
SAFE_METHODS: Final = frozenset(("GET", "HEAD", "OPTIONS"))
GUARD: Final = "map3d_guard"
"""Attribute of a guarded view function: the role that it requires, or PUBLIC_QUERY or SIGN_IN."""
PUBLIC_QUERY: Final = "public query"
SIGN_IN: Final = "sign-in"

View = TypeVar("View", bound=Callable[..., Any])


@dataclass(frozen=True)
class Caller:
    """Who sent a request. `session`: the session of its cookie, also one without a user."""

    identity: Identity | None
    session: Session | None


class AccessControl:
    """Recognises callers. One per process; opens the catalogue and the key of sessions on first use. Thread-safe."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._lock = threading.Lock()
        self._catalogue: Catalogue | None = None
        self._sessions: Sessions | None = None
        self._limits: SignInLimits | None = None

    @property
    def accounts(self) -> Accounts:
        with self._lock:
            self._catalogue = self._catalogue or self._workspace.open_catalogue()
            return Accounts(self._catalogue)

    @property
    def sessions(self) -> Sessions:
        with self._lock:
            self._sessions = self._sessions or Sessions(self._workspace.root)
            return self._sessions

    @property
    def limits(self) -> SignInLimits:
        with self._lock:
            self._limits = self._limits or SignInLimits(self._workspace.root)
            return self._limits

    def recognise(self, cookie: str | None, authorization: str | None) -> Caller:
        """Returns who sends these headers. An invalid token authenticates no one, even with a valid cookie."""
        if authorization is not None:
            scheme, _, token = authorization.partition(" ")
            return Caller(self.accounts.find_token(token.strip()) if scheme.lower() == "bearer" else None, None)
        session = self.sessions.load(cookie) if cookie else None
        if session is None or not session.user:
            return Caller(None, session)
        user = self.accounts.find_user(session.user)
        if user is None or not session.belongs_to(user):
            return Caller(None, None)
        return Caller(Identity(user.name, user.role), session)

    def check(self, caller: Caller, role: Role, method: str, csrf: str | None) -> Identity:
        """Returns the caller's identity. Raises SignInRequired, or Forbidden for a lesser role and for a write by cookie without its CSRF value."""
        if caller.identity is None:
            raise SignInRequired("sign in, or send a token in the header Authorization: Bearer TOKEN")
        if not caller.identity.may(role):
            raise Forbidden(f"this needs the role {role}; {caller.identity.user} has the role {caller.identity.role}")
        if method not in SAFE_METHODS and caller.identity.token is None:
            check_csrf(caller.session, csrf)
        return caller.identity

    def close(self) -> None:
        with self._lock:
            for opened in (self._catalogue, self._limits):
                if opened is not None:
                    opened.close()
            self._catalogue = self._limits = None


def check_csrf(session: Session | None, value: str | None) -> None:
    """Raises Forbidden unless the value is the session's."""
    if session is None or not session.is_csrf(value or ""):
        raise Forbidden("this form is no longer valid; go back, reload the page and send it again")


# -- in Flask ----------------------------------------------------------------------------------------------------------------------------


def requires(role: Role) -> Callable[[View], View]:
    """Guards a view function: only callers with the role or a higher one. For a write, the role is `editor`."""

    def guard(view: View) -> View:
        @wraps(view)
        def guarded(*arguments: Any, **named: Any) -> Any:
            require(role)
            return view(*arguments, **named)

        return mark(guarded, role)  # type: ignore[return-value]

    return guard


def public_query(view: View) -> View:
    """Marks a view function that answers POST without changing anything, because a standard sends queries so. It needs no sign-in."""
    return mark(view, PUBLIC_QUERY)


def mark(view: View, guard: str) -> View:
    setattr(view, GUARD, guard)
    return view


def require(role: Role) -> Identity:
    """Returns the identity of the current request's caller. Raises SignInRequired, Forbidden."""
    caller = current_caller()
    return access().check(caller, role, request.method, sent_csrf() if caller.session else None)


def access() -> AccessControl:
    found: AccessControl = current_app.extensions[ACCESS]
    return found


def current_caller() -> Caller:
    """Returns who sent the current request; looked up once per request."""
    caller: Caller | None = g.get("map3d_caller")
    if caller is None:
        caller = g.map3d_caller = access().recognise(request.cookies.get(COOKIE), request.headers.get("Authorization"))
    return caller


def sent_csrf() -> str | None:
    return request.headers.get(CSRF_HEADER) or request.form.get(CSRF_FIELD)


def check_guarded(rule: str, view: Callable[..., Any] | None, methods: Iterable[str] | None) -> None:
    """Raises TypeError for a route that accepts writes by a view function without a guard."""
    accepted = {method.upper() for method in methods or getattr(view, "methods", None) or ("GET",)}
    if accepted - SAFE_METHODS and not hasattr(view, GUARD):
        raise TypeError(f"route {rule} accepts {', '.join(sorted(accepted))} without a guard; add @requires('editor') of map3d.web.http.access")
