"""Users of the web interface, for tests."""

import re

from map3d.accounts import Accounts

PASSWORD = "correct horse battery"


def add_user(workspace, name="anna", role="editor"):
    catalogue = workspace.open_catalogue()
    try:
        Accounts(catalogue).add_user(name, PASSWORD, role)
    finally:
        catalogue.close()


def add_token(workspace, name="anna", role="editor"):
    catalogue = workspace.open_catalogue()
    try:
        return Accounts(catalogue).add_token(name, "test", role)[1]
    finally:
        catalogue.close()


def csrf_of(response):
    """Returns the CSRF value of the first form of a page."""
    return re.search(r'name="csrf" value="([^"]+)"', response.text)[1]


def sign_in(client, name="anna", password=PASSWORD, **fields):
    """Signs in as a browser does: fetches the form, then sends it. Returns the answer."""
    value = csrf_of(client.get("/sign-in"))
    return client.request("POST", "/sign-in", data={"csrf": value, "name": name, "password": password, **fields})
