"""The cookie of sessions."""

from typing import Any, Final
from urllib.parse import urlsplit

from starlette.responses import Response

from map3d.accounts import Session
from map3d.accounts.sessions import MAX_AGE_S
from map3d.web.http.access import COOKIE
from map3d.web.http.clients import client_scheme
from map3d.web.http.current import request, site

_SAME_SITE: Final[Any] = "Lax"


def set_session(response: Response, session: Session) -> None:
    """Sends the session as a cookie that scripts cannot read and other sites do not send with forms."""
    response.set_cookie(
        COOKIE,
        site().access.sessions.dump(session),
        max_age=MAX_AGE_S if session.user else None,
        path=_path(),
        secure="https" in (client_scheme(request().scope, site().settings.trusted_proxies), urlsplit(site().settings.public_url or "").scheme),
        httponly=True,
        samesite=_SAME_SITE,
    )


def delete_session(response: Response) -> None:
    response.delete_cookie(COOKIE, path=_path(), httponly=True, samesite=_SAME_SITE)


def _path() -> str:
    return urlsplit(site().settings.public_url or "").path.rstrip("/") + "/"
