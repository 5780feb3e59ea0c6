"""Pages of accounts: sign in, sign out, password, tokens."""

from urllib.parse import urlsplit

from starlette.responses import Response

from map3d.catalogue import ROLES, Role
from map3d.errors import BadRequest, Forbidden, NotFound
from map3d.web.http.access import check_csrf
from map3d.web.http.clients import client_address
from map3d.web.http.current import request, site
from map3d.web.http.guards import SIGN_IN, mark, require, requires, sent_csrf
from map3d.web.http.responses import redirect, uncached
from map3d.web.http.routes import Routes
from map3d.web.http.session_cookie import delete_session, set_session
from map3d.web.pages.tools import relative, render, translate

accounts = Routes("accounts")


@accounts.get("/sign-in")
def sign_in() -> Response:
    return _sign_in_page(request().query_params.get("next", ""))


def send_sign_in() -> Response:
    """Signs in, and redirects to the page that asked for it. Counts failures before it computes a hash."""
    check_csrf(request().caller.session, sent_csrf())
    name, password, back = (request().form.get(field, "") for field in ("name", "password", "next"))
    address = _client_address()
    limits = site().access.limits
    limits.take(name, address)
    user = site().access.accounts.check_password(name, password)
    if user is None:
        return _sign_in_page(back, translate("The name or the password is wrong."), name, 403)
    limits.succeeded(name, address)
    response = redirect(relative(_own_path(back)))
    request().new_session = None
    set_session(response, site().access.sessions.start(user))
    return response


accounts.post("/sign-in", most_bytes=4 << 10)(mark(send_sign_in, SIGN_IN))


@accounts.post("/sign-out")
@requires("viewer")
def sign_out() -> Response:
    response = redirect(relative("renderings"))
    delete_session(response)
    return response


@accounts.get("/account")
@requires("viewer")
def account() -> Response:
    return _account_page()


@accounts.post("/account/password")
@requires("viewer")
def change_password() -> Response:
    """Changes the password; the new session replaces all others of the user."""
    name, address = require("viewer").user, _client_address()
    site().access.limits.take(name, address)
    if site().access.accounts.check_password(name, request().form.get("old", "")) is None:
        return _account_page(problem=translate("The current password is wrong."), status=403)
    site().access.limits.succeeded(name, address)
    try:
        site().access.accounts.set_password(name, request().form.get("new", ""))
    except BadRequest as error:
        return _account_page(problem=str(error), status=400)
    response = redirect(relative("account"))
    set_session(response, site().access.sessions.start(site().access.accounts.find_user(name)))
    return response


@accounts.post("/account/tokens")
@requires("viewer")
def add_token() -> Response:
    """Shows the new token, once."""
    identity = require("viewer")
    role: Role = next((role for role in ROLES if role == request().form.get("role")), "viewer")
    if not identity.may(role) or identity.token is not None:
        raise Forbidden("a token cannot do more than its user, and cannot make further tokens")
    try:
        _, text = site().access.accounts.add_token(identity.user, request().form.get("title", ""), role)
    except BadRequest as error:
        return _account_page(problem=str(error), status=400)
    return _account_page(new_token=text)


@accounts.post("/account/tokens/{id}/remove")
@requires("viewer")
def remove_token(id: str) -> Response:
    own = site().access.accounts.catalogue.tokens(require("viewer").user)
    if id not in [token.id for token in own]:
        raise NotFound(f"no token {id[:64]!r} of yours")
    site().access.accounts.catalogue.remove_token(id)
    return redirect(relative("account"))


def _sign_in_page(back: str, problem: str = "", name: str = "", status: int = 200) -> Response:
    page = render("sign_in.html", next=_own_path(back), problem=problem, name=name[:64], users=site().access.accounts.exist())
    return uncached(page, status)


def _account_page(*, problem: str = "", new_token: str = "", status: int = 200) -> Response:
    identity = require("viewer")
    tokens = site().access.accounts.catalogue.tokens(identity.user)
    page = render("account.html", identity=identity, tokens=tokens, problem=problem, new_token=new_token, roles=ROLES)
    return uncached(page, status)


def _own_path(path: str) -> str:
    """Returns the path if it belongs to this server, else that of the web interface."""
    parts = urlsplit(path.strip())
    own = path.startswith("/") and not path.startswith("//") and "\\" not in path and path.isprintable() and not parts.netloc and not parts.scheme
    return path if own else "/renderings"


def _client_address() -> str:
    return client_address(request().scope, site().settings.trusted_proxies)
