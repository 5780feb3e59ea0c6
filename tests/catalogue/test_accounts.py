"""Users and tokens."""

import dataclasses
from collections.abc import Callable

import pytest

from map3d.catalogue import Catalogue, TokenRecord, UserRecord
from map3d.errors import AlreadyExists, NotFound

ANNA = UserRecord("anna", "scrypt:…", "editor")
BEN = UserRecord("ben", "scrypt:…", "viewer")


def without_time(records: list[UserRecord] | list[TokenRecord]) -> list[UserRecord | TokenRecord]:
    return [dataclasses.replace(record, created_s=0.0) for record in records]


def token(id: str, user: str = "anna") -> TokenRecord:
    return TokenRecord(id, user, "nightly import", "editor", f"digest of {id}")


def test_users_round_trip_in_order(catalogue: Catalogue, open_at: Callable[..., Catalogue]) -> None:
    before_s = catalogue.clock_s()
    for user in (BEN, ANNA):
        catalogue.create_user(user)
    again = open_at()
    assert without_time(again.users()) == [ANNA, BEN]
    assert before_s - 0.01 <= again.user("anna").created_s <= catalogue.clock_s() + 0.01
    with pytest.raises(AlreadyExists, match="anna"):
        again.create_user(ANNA)
    with pytest.raises(NotFound, match="'carl'; existing users: anna, ben"):
        again.user("carl")


def test_update_changes_password_and_role_only(catalogue: Catalogue) -> None:
    catalogue.create_user(BEN)
    created_s = catalogue.user("ben").created_s
    catalogue.update_user(UserRecord("ben", "other", "editor", 5.0))
    assert catalogue.user("ben") == UserRecord("ben", "other", "editor", created_s)
    with pytest.raises(NotFound, match="carl"):
        catalogue.update_user(UserRecord("carl", "x", "viewer"))


def test_token_is_found_by_its_digest_until_it_is_removed(catalogue: Catalogue) -> None:
    for user in (ANNA, BEN):
        catalogue.create_user(user)
    for one in (token("b"), token("a"), token("c", "ben")):
        catalogue.create_token(one)
    assert without_time(catalogue.tokens()) == [token("a"), token("b"), token("c", "ben")]
    assert without_time(catalogue.tokens("ben")) == [token("c", "ben")]
    found = catalogue.find_token("digest of b")
    assert found is not None
    assert found.created_s > 0
    assert dataclasses.replace(found, created_s=0.0) == token("b")
    catalogue.remove_token("b")
    assert catalogue.find_token("digest of b") is None
    with pytest.raises(NotFound, match="'b'; existing tokens: a, c"):
        catalogue.remove_token("b")
    with pytest.raises(AlreadyExists):
        catalogue.create_token(token("a"))
    with pytest.raises(NotFound, match="nobody"):
        catalogue.create_token(token("d", "nobody"))


def test_tokens_leave_with_their_user(catalogue: Catalogue) -> None:
    for user in (ANNA, BEN):
        catalogue.create_user(user)
    for one in (token("a"), token("c", "ben")):
        catalogue.create_token(one)
    catalogue.remove_user("anna")
    assert [kept.name for kept in catalogue.users()] == ["ben"]
    assert [kept.id for kept in catalogue.tokens()] == ["c"]
    with pytest.raises(NotFound, match="anna"):
        catalogue.remove_user("anna")
