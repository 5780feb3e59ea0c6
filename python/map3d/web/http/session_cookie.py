"""The cookie of sessions."""

from urllib.parse import urlsplit

from flask import current_app, request
from werkzeug import Response

from map3d.accounts import Session
from map3d.accounts.sessions import MAX_AGE_S
from map3d.web.http.access import COOKIE, access
from map3d.web.http.settings import ServerSettings


def set_session(response: Response, session: Session) -> None:
    """Sends the session as a cookie that scripts cannot read and other sites do not send with forms."""
    response.set_cookie(
        COOKIE,
        access().sessions.dump(session),
        max_age=MAX_AGE_S if session.user else None,
        path=_path(),
        secure=request.is_secure or (_settings().public_url or "").startswith("https:"),
        httponly=True,
        samesite="Lax",
    )


def delete_session(response: Response) -> None:
    response.delete_cookie(COOKIE, path=_path(), httponly=True, samesite="Lax")


def _path() -> str:
    return urlsplit(_settings().public_url or "").path.rstrip("/") + "/"


def _settings() -> ServerSettings:
    settings: ServerSettings = current_app.config["SETTINGS"]
    return settings
