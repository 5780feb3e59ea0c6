"""What all templates use: relative URLs, translations, the caller, the CSRF value of forms."""

import json
from functools import cache
from typing import Any, Final

from jinja2 import Environment, FileSystemLoader
from markupsafe import Markup

from map3d.web.http.access import COOKIE, CSRF_FIELD
from map3d.web.http.current import request
from map3d.web.http.host_folders import without_host_folders
from map3d.web.pages.formats import FILTERS, number_or_text
from map3d.web.pages.language import TRANSLATIONS, language

TEMPLATES: Final = Environment(loader=FileSystemLoader(TRANSLATIONS.with_name("templates")), autoescape=True, trim_blocks=True, lstrip_blocks=True)


def render(template: str, **values: Any) -> str:
    """Returns the page that a template makes of the values."""
    return TEMPLATES.get_template(template).render(values)


def relative(path: str) -> str:
    """Returns a path below the server's root relative to the current page, so that it is right behind every proxy."""
    up = request()["path"].count("/") - 1
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
    asked = request()
    return asked.caller.identity if asked.cookies.get(COOKIE) or "authorization" in asked.headers else None


def csrf_value() -> str:
    """Returns the value that forms send back. A visitor without a session gets a new one with the response."""
    asked = request()
    session = asked.caller.session or asked.new_session
    if session is None:
        session = asked.new_session = asked.site.access.sessions.start()
    return session.csrf


def csrf_field() -> Markup:
    return Markup('<input type="hidden" name="{}" value="{}">').format(CSRF_FIELD, csrf_value())


TEMPLATES.globals.update(_=translate, language=language, relative=relative, caller=page_caller, csrf=csrf_field, csrf_value=csrf_value)
TEMPLATES.filters.update(FILTERS, without_host_folders=without_host_folders)
