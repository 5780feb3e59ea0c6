"""Who sends a request, and what they may do.

A browser proves who it is with a signed session cookie, and sends with each form the value that only pages of this server contain. A program sends
`Authorization: Bearer TOKEN`.
"""

import threading
from dataclasses import dataclass
from typing import Final

from map3d.accounts import Accounts, Identity, Session, Sessions, SignInLimits
from map3d.catalogue import Role
from map3d.errors import Forbidden, SignInRequired
from map3d.web.http.shared_catalogue import SharedCatalogue

COOKIE: Final = "map3d_session"
CSRF_FIELD: Final = "csrf"
CSRF_HEADER: Final = "X-CSRF-Token"
SAFE_METHODS: Final = frozenset(("GET", "HEAD", "OPTIONS"))


@dataclass(frozen=True)
class Caller:
    """Who sent a request. `session`: the session of its cookie, also one without a user."""

    identity: Identity | None
    session: Session | None


class AccessControl:
    """Recognises callers. One per process; opens the key of sessions on first use. Thread-safe."""

    def __init__(self, catalogue: SharedCatalogue) -> None:
        self._catalogue, self._workspace = catalogue, catalogue.workspace
        self._lock = threading.Lock()
        self._sessions: Sessions | None = None
        self._limits: SignInLimits | None = None

    @property
    def accounts(self) -> Accounts:
        return Accounts(self._catalogue())

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
            if self._limits is not None:
                self._limits.close()
                self._limits = None


def check_csrf(session: Session | None, value: str | None) -> None:
    """Raises Forbidden unless the value is the session's."""
    if session is None or not session.is_csrf(value or ""):
        raise Forbidden("this form is no longer valid; go back, reload the page and send it again")
