"""Pages of accounts: sign in, sign out, password, tokens."""

import ipaddress
from urllib.parse import urlsplit

from flask import Blueprint, g, redirect, render_template, request, url_for
from werkzeug import Response

from map3d.catalogue import ROLES, Role
from map3d.errors import BadRequest, Forbidden, NotFound
from map3d.web.http.access import SIGN_IN, access, check_csrf, current_caller, mark, require, requires, sent_csrf
from map3d.web.http.session_cookie import delete_session, set_session
from map3d.web.pages.tools import relative, translate

accounts = Blueprint("accounts", __name__)


@accounts.get("/sign-in")
def sign_in() -> Response:
    return _sign_in_page(request.args.get("next", ""))


def send_sign_in() -> Response:
    """Signs in, and redirects to the page that asked for it. Counts failures before it computes a hash."""
    check_csrf(current_caller().session, sent_csrf())
    name, password, back = (request.form.get(field, "") for field in ("name", "password", "next"))
    address = _client_address()
    limits = access().limits
    limits.take(name, address)
    user = access().accounts.check_password(name, password)
    if user is None:
        return _sign_in_page(back, translate("The name or the password is wrong."), name, 403)
    limits.succeeded(name, address)
    response = redirect(relative(_own_path(back)), 303)
    g.pop("map3d_new_session", None)
    set_session(response, access().sessions.start(user))
    return _uncached(response)


accounts.post("/sign-in")(mark(send_sign_in, SIGN_IN))


@accounts.post("/sign-out")
@requires("viewer")
def sign_out() -> Response:
    response = redirect(relative("renderings"), 303)
    delete_session(response)
    return _uncached(response)


@accounts.get("/account")
@requires("viewer")
def account() -> Response:
    return _account_page()


@accounts.post("/account/password")
@requires("viewer")
def change_password() -> Response:
    """Changes the password; the new session replaces all others of the user."""
    name, address = require("viewer").user, _client_address()
    access().limits.take(name, address)
    if access().accounts.check_password(name, request.form.get("old", "")) is None:
        return _account_page(problem=translate("The current password is wrong."), status=403)
    access().limits.succeeded(name, address)
    try:
        access().accounts.set_password(name, request.form.get("new", ""))
    except BadRequest as error:
        return _account_page(problem=str(error), status=400)
    response = redirect(relative("account"), 303)
    set_session(response, access().sessions.start(access().accounts.find_user(name)))
    return _uncached(response)


@accounts.post("/account/tokens")
@requires("viewer")
def add_token() -> Response:
    """Shows the new token, once."""
    identity = require("viewer")
    role: Role = next((role for role in ROLES if role == request.form.get("role")), "viewer")
    if not identity.may(role) or identity.token is not None:
        raise Forbidden("a token cannot do more than its user, and cannot make further tokens")
    try:
        _, text = access().accounts.add_token(identity.user, request.form.get("title", ""), role)
    except BadRequest as error:
        return _account_page(problem=str(error), status=400)
    return _account_page(new_token=text)


@accounts.post("/account/tokens/<id>/remove")
@requires("viewer")
def remove_token(id: str) -> Response:
    own = access().accounts.catalogue.tokens(require("viewer").user)
    if id not in [token.id for token in own]:
        raise NotFound(f"no token {id[:64]!r} of yours")
    access().accounts.catalogue.remove_token(id)
    return _uncached(redirect(relative("account"), 303))


def _sign_in_page(back: str, problem: str = "", name: str = "", status: int = 200) -> Response:
    page = render_template("sign_in.html", next=_own_path(back), problem=problem, name=name[:64], users=access().accounts.exist())
    return _uncached(Response(page, status, mimetype="text/html"))


def _account_page(*, problem: str = "", new_token: str = "", status: int = 200) -> Response:
    identity = require("viewer")
    tokens = access().accounts.catalogue.tokens(identity.user)
    page = render_template("account.html", identity=identity, tokens=tokens, problem=problem, new_token=new_token, roles=ROLES)
    return _uncached(Response(page, status, mimetype="text/html"))


def _own_path(path: str) -> str:
    """Returns the path if it belongs to this server, else that of the web interface."""
    parts = urlsplit(path.strip())
    own = path.startswith("/") and not path.startswith("//") and "\\" not in path and path.isprintable() and not parts.netloc and not parts.scheme
    return path if own else url_for("pages.renderings")


def _client_address() -> str:
    """Returns the client's network address. Trusts the last X-Forwarded-For address if the request comes from this host."""
    address = request.remote_addr or ""
    forwarded = request.headers.get("X-Forwarded-For", "").rpartition(",")[2].strip()
    try:
        return str(ipaddress.ip_address(forwarded)) if forwarded and ipaddress.ip_address(address).is_loopback else address
    except ValueError:
        return address


def _uncached(response: Response) -> Response:
    response.headers["Cache-Control"] = "no-store"
    return response
