"""Guards: no route accepts a write without one, and each guard refuses the wrong caller."""

import re
from html import unescape

import pytest

from map3d.web.http.access import SAFE_METHODS
from map3d.web.http.guards import GUARD, SIGN_IN, requires
from map3d.web.http.routes import Routes
from map3d.web.server.asgi_app import App
from tests.web.accounts import PASSWORD, add_token, add_user, csrf_of, sign_in

OWN_ACCOUNT = {"accounts.sign_out", "accounts.change_password", "accounts.add_token", "accounts.remove_token"}
"""Writes that a viewer may do: only to the own account."""


def writes(app: App):
    """Yields (rule, method, guard) of every route that accepts another method than GET, HEAD and OPTIONS."""
    for rule in app.views.rules:
        if rule.method not in SAFE_METHODS:
            yield rule, rule.method, getattr(rule.view, GUARD, None)


def path_of(rule):
    return re.sub(r"{[^}]*}", "x", rule.path)


def test_every_write_has_a_guard(client):
    listed = list(writes(client.app))
    assert {"accounts.send_sign_in", "accounts.add_token"} <= {rule.name for rule, _, _ in listed}
    for rule, method, guard in listed:
        if rule.name == "accounts.send_sign_in":
            assert guard == SIGN_IN
        else:
            assert guard == ("viewer" if rule.name in OWN_ACCOUNT else "editor"), f"{method} {rule.path}: {rule.name}"


def test_every_write_is_refused_to_visitors_and_to_invalid_tokens(client):
    for rule, method, guard in writes(client.app):
        if guard != SIGN_IN:
            for headers in ({}, {"authorization": "Bearer map3d_wrong"}, {"authorization": "Basic eDp5"}, {"cookie": "map3d_session=forged"}):
                response = client.request(method, path_of(rule), headers=headers)
                assert response.status_code == 401, f"{method} {rule.path}"
                assert response.headers["www-authenticate"].startswith("Bearer")
                assert response.headers["cache-control"] == "no-store"


def test_every_write_of_an_editor_is_refused_to_viewers(client, workspace):
    add_user(workspace, role="viewer")
    token = add_token(workspace, role="editor")
    for rule, method, guard in writes(client.app):
        if guard == "editor":
            assert client.request(method, path_of(rule), headers={"authorization": f"Bearer {token}"}).status_code == 403, f"{method} {rule.path}"


def test_every_write_by_cookie_needs_the_csrf_value(client, workspace):
    add_user(workspace)
    sign_in(client)
    for rule, method, _ in writes(client.app):
        for data in ({}, {"csrf": ""}, {"csrf": "x" * 32}):
            assert client.request(method, path_of(rule), data=data).status_code == 403, f"{method} {rule.path}"


def test_unguarded_write_does_not_start():
    routes = Routes("test")
    with pytest.raises(TypeError, match="without a guard"):
        routes.post("/x")(lambda: "x")
    for method in ("POST", "PUT", "DELETE", "PATCH"):
        with pytest.raises(TypeError, match="without a guard"):
            routes.add(method, "/x", lambda: "x")
    assert list(routes) == []
    routes.get("/a")(lambda: "a")
    routes.post("/b")(requires("editor")(lambda: "b"))
    assert [rule.path for rule in routes] == ["/a", "/b"]


def test_sign_in_leads_back_to_the_page_that_asked(client, workspace):
    add_user(workspace)
    asked = client.get("/account", headers={"accept": "text/html"})
    assert (asked.status_code, asked.headers["location"]) == (303, "sign-in?next=/account")
    assert client.get("/account").status_code == 401
    assert 'value="/account"' in client.get("/sign-in?next=/account").text
    response = sign_in(client, next="/account")
    assert (response.status_code, response.headers["location"]) == (303, "account")
    cookie = response.headers["set-cookie"]
    assert {"HttpOnly", "SameSite=Lax", "Path=/"} <= set(cookie.split("; "))
    assert PASSWORD not in cookie
    page = client.get("/account")
    assert (page.status_code, page.headers["cache-control"]) == (200, "no-store")
    assert "anna" in page.text


def test_cookie_is_secure_behind_https(client, workspace):
    assert "Secure" not in client.get("/sign-in").headers["set-cookie"] if "set-cookie" in client.get("/sign-in").headers else True
    add_user(workspace)
    assert "Secure" not in client.get("/sign-in").headers["set-cookie"]
    from dataclasses import replace

    client.app.site.settings = replace(client.app.site.settings, public_url="https://example.org/maps")
    client._client.cookies.clear()
    cookie = client.get("/sign-in").headers["set-cookie"].split("; ")
    assert {"Secure", "Path=/maps/"} <= set(cookie)


@pytest.mark.parametrize(
    "next", ["https://evil.example/", "//evil.example", "/\\evil.example", "javascript:alert(1)", "/\tx", "", "evil", "/%0d%0aX: y\r\n"]
)
def test_sign_in_never_leads_to_another_site(client, workspace, next):
    add_user(workspace)
    location = sign_in(client, next=next).headers["location"]
    assert location in ("renderings", "%0d%0aX: y") or location == "renderings"


def test_wrong_password_says_no_more_than_that(client, workspace):
    add_user(workspace)
    answers = [sign_in(client, name, password) for name, password in (("anna", "wrong"), ("nobody", PASSWORD), ("<b>", "x"))]
    assert {answer.status_code for answer in answers} == {403}
    texts = [re.sub(r'value="[^"]*"', "", answer.text) for answer in answers]
    assert texts[0] == texts[1] == texts[2]
    assert "<b>" not in answers[2].text
    assert client.get("/account").status_code == 401


def test_sign_in_without_the_forms_value_is_refused(client, workspace):
    add_user(workspace)
    assert client.request("POST", "/sign-in", data={"name": "anna", "password": PASSWORD}).status_code == 403
    client.get("/sign-in")
    assert client.request("POST", "/sign-in", data={"name": "anna", "password": PASSWORD, "csrf": "x"}).status_code == 403


def test_sign_ins_are_limited(client, workspace):
    add_user(workspace)
    for _ in range(10):
        assert sign_in(client, password="wrong").status_code == 403
    refused = sign_in(client)
    assert refused.status_code == 429
    assert 0 < int(refused.headers["retry-after"]) <= 900
    assert client.get("/account").status_code == 401


def test_only_a_proxy_on_this_host_names_the_clients_address(client, workspace):
    """Otherwise a client could choose another address for each attempt."""
    add_user(workspace)

    def attempt(number, remote):
        client.come_from(remote)
        value = csrf_of(client.get("/sign-in"))
        headers = {"X-Forwarded-For": f"198.51.100.7, 10.0.0.{number}"}
        data = {"csrf": value, "name": f"user{number}", "password": "x"}
        return client.request("POST", "/sign-in", data=data, headers=headers).status_code

    assert [attempt(number, "203.0.113.5") for number in range(31)] == [403] * 30 + [429]
    assert [attempt(number, "127.0.0.1") for number in range(100, 131)] == [403] * 31


def test_sign_out_ends_the_session(client, workspace):
    add_user(workspace)
    sign_in(client)
    value = csrf_of(client.get("/account"))
    assert client.request("POST", "/sign-out", data={"csrf": value}).status_code == 303
    assert client.get("/account").status_code == 401


def test_new_password_ends_the_other_sessions(client, workspace):
    add_user(workspace)
    sign_in(client)
    old = client._client.cookies["map3d_session"]
    value = csrf_of(client.get("/account"))

    def change(**fields):
        return client.request("POST", "/account/password", data={"csrf": value, **fields})

    assert change(old="wrong", new="another long one").status_code == 403
    assert change(old=PASSWORD, new="short").status_code == 400
    assert change(old=PASSWORD, new="another long one").status_code == 303
    assert client.get("/account").status_code == 200
    client._client.cookies.clear()
    assert client.get("/account", headers={"cookie": f"map3d_session={old}"}).status_code == 401


def test_token_is_shown_once_and_works_until_it_is_removed(client, workspace):
    add_user(workspace)
    sign_in(client)
    value = csrf_of(client.get("/account"))
    made = client.request("POST", "/account/tokens", data={"csrf": value, "title": "nightly <import>", "role": "editor"})
    token = unescape(re.search(r"<code>(map3d_[^<]+)</code>", made.text)[1])
    page = client.get("/account").text
    assert token not in page
    assert "nightly &lt;import&gt;" in page
    client._client.cookies.clear()
    headers = {"authorization": f"Bearer {token}"}
    assert client.get("/account", headers=headers).status_code == 200
    assert client.request("POST", "/account/tokens", data={"title": "x"}, headers=headers).status_code == 403, "a token makes no tokens"
    id = re.search(r"account/tokens/([0-9a-f]+)/remove", page)[1]
    assert client.request("POST", f"/account/tokens/{id}/remove", headers=headers).status_code == 303
    assert client.get("/account", headers=headers).status_code == 401


def test_a_user_removes_no_token_of_another(client, workspace):
    add_user(workspace)
    add_user(workspace, "ben")
    add_token(workspace, "ben")
    catalogue = workspace.open_catalogue()
    id = catalogue.tokens("ben")[0].id
    catalogue.close()
    headers = {"authorization": f"Bearer {add_token(workspace)}"}
    assert client.request("POST", f"/account/tokens/{id}/remove", headers=headers).status_code == 404


def test_without_users_the_page_says_how_to_add_one(client):
    assert "map3d users add" in client.get("/sign-in").text


def test_pages_speak_german_to_those_who_ask(client, workspace):
    add_user(workspace)
    assert "Anmelden" in client.get("/sign-in", headers={"accept-language": "de-CH,en;q=0.5"}).text
    assert "Sign in" in client.get("/sign-in", headers={"accept-language": "fr"}).text


def test_visitors_get_no_cookie(client):
    for path in ("/", "/renderings", "/healthz", "/tiles/tea/rendering.json"):
        assert "set-cookie" not in client.get(path).headers


def test_session_key_stays_out_of_answers(client, workspace):
    add_user(workspace)
    sign_in(client)
    key = (workspace.root / "session.key").read_text().strip()
    for path in ("/account", "/sign-in", "/static/../session.key", "/static/%2e%2e/session.key"):
        assert key not in client.get(path).text
