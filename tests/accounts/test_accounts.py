"""Passwords, tokens, sessions, the key of sessions, limits of failed sign-ins."""

import stat
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d.accounts import Accounts, Identity, Sessions, SignInLimits, TooManySignIns, passwords, sessions, sign_in_limits
from map3d.accounts.sessions import KEY_FILE
from map3d.catalogue import Workspace
from map3d.errors import AlreadyExists, BadName, BadRequest, StoreError

PASSWORD = "correct horse battery"


@pytest.fixture
def accounts(tmp_path: Path) -> Iterator[Accounts]:
    catalogue = Workspace(tmp_path).open_catalogue()
    yield Accounts(catalogue)
    catalogue.close()


def test_only_the_right_password_opens(accounts: Accounts) -> None:
    assert not accounts.exist()
    accounts.add_user("anna", PASSWORD, "editor")
    assert accounts.exist()
    user = accounts.check_password("anna", PASSWORD)
    assert user is not None
    assert PASSWORD not in user.password_hash
    for name, password in (
        ("anna", PASSWORD.upper()),
        ("anna", ""),
        ("ben", PASSWORD),
        ("Anna", PASSWORD),
        ("anna", "x" * 10_000),
        ("ann\x00a", PASSWORD),
    ):
        assert accounts.check_password(name, password) is None
    accounts.set_password("anna", "another long one")
    assert accounts.check_password("anna", PASSWORD) is None
    assert accounts.check_password("anna", "another long one") is not None


@pytest.mark.parametrize("name", ["", "Anna", "a b", "-a", "a/b", "ä", "a" * 65, "a\n", "٣"])
def test_invalid_user_names_are_refused(accounts: Accounts, name: str) -> None:
    with pytest.raises(BadName):
        accounts.add_user(name, PASSWORD, "viewer")


@pytest.mark.parametrize(("password", "accepted"), [("x" * 9, False), ("x" * 10, True), ("x" * 256, True), ("x" * 257, False), ("anna123456", False)])
def test_length_of_passwords(accounts: Accounts, password: str, accepted: bool) -> None:
    if accepted:
        accounts.add_user("anna", password, "viewer")
        assert accounts.check_password("anna", password) is not None
    else:
        with pytest.raises(BadRequest, match="password"):
            accounts.add_user("anna", password, "viewer")


def test_a_hash_takes_32_mib(accounts: Accounts) -> None:
    accounts.add_user("anna", PASSWORD, "viewer")
    assert accounts.catalogue.user("anna").password_hash.startswith("scrypt:32768:8:1$")


def test_unknown_names_cost_a_hash_too(accounts: Accounts, monkeypatch: pytest.MonkeyPatch) -> None:
    passwords._dummy_hash()
    hashed: list[str] = []
    monkeypatch.setattr(passwords, "_make_hash", lambda password, *_: hashed.append(password) or "")
    accounts.check_password("nobody", PASSWORD)
    assert hashed == [PASSWORD]


def test_hashes_of_earlier_versions_are_read() -> None:
    digest = "bd96e2a23f100ed831e487ee3032348fbd194fa445b64558f0f9473380fc58db672382c22e88baf7af0c7ee214a8d8e730c030e6dc514e793e6245c2eb8d1d55"
    stored = f"scrypt:256:8:1$CjvvcxKWPkkCk2GX${digest}"
    assert passwords.is_password("correct horse battery", stored)
    assert not passwords.is_password("correct horse batterY", stored)
    assert passwords.hash_password("correct horse battery").startswith(f"{passwords.METHOD}$")


def test_token_stands_for_its_user_with_the_lesser_role(accounts: Accounts) -> None:
    accounts.add_user("anna", PASSWORD, "editor")
    record, text = accounts.add_token("anna", " nightly ", "editor")
    reader, reader_text = accounts.add_token("anna", "reader", "viewer")
    assert record.title == "nightly"
    assert text not in repr(accounts.catalogue.tokens())
    assert accounts.find_token(text) == Identity("anna", "editor", record.id)
    assert accounts.find_token(reader_text) == Identity("anna", "viewer", reader.id)
    accounts.set_role("anna", "viewer")
    assert accounts.find_token(text) == Identity("anna", "viewer", record.id)
    for wrong in ("", text[:-1], text.upper(), record.digest, "map3d_"):
        assert accounts.find_token(wrong) is None
    accounts.catalogue.remove_user("anna")
    assert accounts.find_token(text) is None


def test_token_needs_a_title(accounts: Accounts) -> None:
    accounts.add_user("anna", PASSWORD, "editor")
    for title in ("", "  ", "x" * 201):
        with pytest.raises(BadRequest, match="title"):
            accounts.add_token("anna", title, "viewer")
    with pytest.raises(AlreadyExists):
        accounts.add_user("anna", PASSWORD, "editor")


def test_session_ends_with_a_new_password_and_with_its_user(accounts: Accounts, tmp_path: Path) -> None:
    accounts.add_user("anna", PASSWORD, "editor")
    made = Sessions(tmp_path)
    text = made.dump(made.start(accounts.find_user("anna")))
    session = Sessions(tmp_path).load(text)
    assert session is not None
    assert session.belongs_to(accounts.find_user("anna"))
    accounts.set_password("anna", "another long one")
    assert not session.belongs_to(accounts.find_user("anna"))
    assert not session.belongs_to(None)


def test_forged_and_old_sessions_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Sessions(tmp_path)
    text = made.dump(made.start())
    (tmp_path / "other").mkdir()
    other = Sessions(tmp_path / "other")
    head, _, rest = text.partition(".")
    for wrong in ("", "x", text[:-1], f"{head[:-2]}AA.{rest}", other.dump(other.start()), f"é{text}"):
        assert made.load(wrong) is None
    monkeypatch.setattr(sessions, "MAX_AGE_S", -1)
    assert made.load(text) is None


def test_key_is_private_and_made_once_by_many_processes(tmp_path: Path) -> None:
    made: list[Sessions] = []
    threads = [threading.Thread(target=lambda: made.append(Sessions(tmp_path))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    text = made[0].dump(made[0].start())
    assert all(one.load(text) is not None for one in made)
    assert [path.name for path in tmp_path.iterdir()] == [KEY_FILE]
    assert stat.S_IMODE((tmp_path / KEY_FILE).stat().st_mode) == 0o600


def test_damaged_key_is_refused(tmp_path: Path) -> None:
    (tmp_path / KEY_FILE).write_text("short\n")
    with pytest.raises(StoreError, match="remove the file"):
        Sessions(tmp_path)


def test_failures_are_limited_by_user_and_by_address(tmp_path: Path) -> None:
    limits, other_process = SignInLimits(tmp_path, per_user=2, per_address=3), SignInLimits(tmp_path, per_user=2, per_address=3)
    limits.take("anna", "10.0.0.1")
    other_process.take("anna", "10.0.0.2")
    with pytest.raises(TooManySignIns, match="15 min"):
        limits.take("anna", "10.0.0.3")
    for name in ("ben", "carl"):
        limits.take(name, "10.0.0.1")
    with pytest.raises(TooManySignIns):
        limits.take("dora", "10.0.0.1")
    limits.take("dora", "10.0.0.2")
    for one in (limits, other_process):
        one.close()


def test_success_clears_the_failures_of_the_user(tmp_path: Path) -> None:
    limits = SignInLimits(tmp_path, per_user=2, per_address=2)
    for _ in range(5):
        limits.take("anna", "10.0.0.1")
        limits.succeeded("anna", "10.0.0.1")
    limits.take("ben", "10.0.0.1")
    limits.take("carl", "10.0.0.1")
    with pytest.raises(TooManySignIns):
        limits.take("anna", "10.0.0.1")
    limits.close()


def test_old_failures_are_forgotten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limits = SignInLimits(tmp_path, per_user=1)
    limits.take("anna", "10.0.0.1")
    with pytest.raises(TooManySignIns) as caught:
        limits.take("anna", "10.0.0.2")
    assert 0 < caught.value.retry_after_s <= sign_in_limits.WINDOW_S
    monkeypatch.setattr(sign_in_limits, "WINDOW_S", -1)
    limits.take("anna", "10.0.0.1")
    limits.close()
