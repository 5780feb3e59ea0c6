"""What all templates use: relative URLs, translations, the caller, the CSRF value of forms."""

import json
from functools import cache
from typing import Any

from flask import Flask, g, request
from markupsafe import Markup

from map3d.accounts import Session
from map3d.web.http.access import COOKIE, CSRF_FIELD, access, current_caller
from map3d.web.http.host_folders import without_host_folders
from map3d.web.http.session_cookie import set_session
from map3d.web.pages.formats import FILTERS, number_or_text
from map3d.web.pages.language import TRANSLATIONS, language


def add_page_tools(app: Flask) -> None:
    """Adds the functions and filters to the templates of the app."""
    app.jinja_env.globals.update(_=translate, language=language, relative=relative, caller=page_caller, csrf=csrf_field, csrf_value=csrf_value)
    app.jinja_env.filters.update(FILTERS, without_host_folders=without_host_folders)
    app.jinja_env.trim_blocks = app.jinja_env.lstrip_blocks = True
    app.after_request(_set_new_session)


def relative(path: str) -> str:
    """Returns a path below the server's root relative to the current page, so that it is right behind every proxy."""
    up = request.path.count("/") - 1
    return "../" * up + path.lstrip("/") or "./"


def translate(text: str, **values: Any) -> str:
    """Returns the text in the language of the request, with `values` in place of {names}; numbers among them as this language writes them."""
    wanted = language()
    found = text if wanted == "en" else translations(wanted).get(text, text)
    return found.format(**{name: number_or_text(value) for name, value in values.items()}) if values else found


@cache
def translations(name: str) -> dict[str, str]:
    """Returns English text → translation."""
    loaded: dict[str, str] = json.loads((TRANSLATIONS / f"{name}.json").read_text("utf-8"))
    return loaded


def page_caller() -> Any:
    """Returns the identity of the signed-in user, None for a visitor. A request without a cookie costs no look-up."""
    return current_caller().identity if request.cookies.get(COOKIE) or request.authorization else None


def csrf_value() -> str:
    """Returns the value that forms send back. A visitor without a session gets a new one with the response."""
    session: Session | None = current_caller().session
    if session is None:
        session = g.get("map3d_new_session")
    if session is None:
        session = g.map3d_new_session = access().sessions.start()
    return session.csrf


def csrf_field() -> Markup:
    return Markup('<input type="hidden" name="{}" value="{}">').format(CSRF_FIELD, csrf_value())


def _set_new_session(response: Any) -> Any:
    session = g.get("map3d_new_session")
    if session is not None:
        set_session(response, session)
    return response
