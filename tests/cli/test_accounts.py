"""map3d users and map3d tokens."""

import io
import json

import pytest

from map3d.accounts import Accounts
from map3d.catalogue import Workspace
from tests.cli.towns import Run

PASSWORD = "correct horse battery"


@pytest.fixture
def type_in(monkeypatch: pytest.MonkeyPatch):
    return lambda text: monkeypatch.setattr("sys.stdin", io.StringIO(text))


def test_users_and_tokens_from_the_first_to_the_last(run: Run, type_in, tmp_path) -> None:
    workspace = str(tmp_path / "new")
    type_in(f"{PASSWORD}\n")
    assert run("users", "add", "anna", "--role", "editor", "-w", workspace)[:2] == (0, "added user anna with the role editor\n")
    assert run("users", "set-role", "anna", "viewer", "-w", workspace)[0] == 0
    status, token, note = run("tokens", "add", "anna", "--title", "nightly", "--role", "viewer", "-w", workspace)
    assert status == 0
    assert "not shown again" in note
    assert json.loads(run("users", "list", "--json", "-w", workspace)[1]) == [{"name": "anna", "role": "viewer", "tokens": 1}]
    (listed,) = json.loads(run("tokens", "list", "--json", "-w", workspace)[1])
    assert (listed["user"], listed["role"], listed["title"]) == ("anna", "viewer", "nightly")
    catalogue = Workspace(tmp_path / "new").open_catalogue()
    accounts = Accounts(catalogue)
    assert accounts.check_password("anna", PASSWORD) is not None
    assert accounts.find_token(token.strip()) is not None
    type_in("another long one\n")
    assert run("users", "set-password", "anna", "-w", workspace)[0] == 0
    assert accounts.check_password("anna", PASSWORD) is None
    assert run("tokens", "remove", listed["id"], "-w", workspace)[0] == 0
    assert accounts.find_token(token.strip()) is None
    assert run("users", "remove", "anna", "--yes", "-w", workspace)[0] == 0
    assert accounts.catalogue.users() == []
    catalogue.close()


@pytest.mark.parametrize(
    ("arguments", "typed", "says"),
    [
        (("users", "add", "Anna"), PASSWORD, "user name 'Anna'"),
        (("users", "add", "anna"), "short", "5 characters"),
        (("users", "add", "anna"), "", "password is empty"),
        (("users", "set-password", "ben"), PASSWORD, "no user 'ben'"),
        (("users", "set-role", "ben", "king"), "", "'king' is not one of"),
        (("tokens", "add", "ben", "--title", "x"), "", "no user 'ben'"),
        (("tokens", "remove", "x"), "", "no token 'x'"),
    ],
)
def test_invalid_requests(run: Run, type_in, tmp_path, arguments, typed: str, says: str) -> None:
    Workspace(tmp_path).open_catalogue().close()
    type_in(typed and f"{typed}\n")
    status, _, err = run(*arguments, "-w", str(tmp_path))
    assert status == 2
    assert says in err
