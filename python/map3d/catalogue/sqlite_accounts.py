"""Users and tokens in SQLite."""

import sqlite3
from typing import Final

from map3d.catalogue import codec
from map3d.catalogue.account_records import TokenRecord, UserRecord, load_token, load_user
from map3d.database import NOW, Database
from map3d.errors import AlreadyExists, NotFound

ACCOUNT_SCHEMA: Final = """
CREATE TABLE user(name TEXT PRIMARY KEY, password_hash TEXT NOT NULL, role TEXT NOT NULL, created_s REAL NOT NULL);
CREATE TABLE token(id TEXT PRIMARY KEY, user TEXT NOT NULL REFERENCES user(name), title TEXT NOT NULL, role TEXT NOT NULL,
  digest TEXT NOT NULL UNIQUE, created_s REAL NOT NULL);
"""


class SqliteAccounts:
    """The account methods of the SQLite catalogue."""

    _database: Database

    def create_user(self, user: UserRecord) -> None:
        with self._database.transaction() as db:
            row = (user.name, user.password_hash, user.role)
            if db.execute(f"INSERT OR IGNORE INTO user VALUES (?, ?, ?, {NOW})", row).rowcount == 0:
                raise AlreadyExists(f"user {user.name}: exists already; choose another name, or use map3d users set-password")

    def user(self, name: str) -> UserRecord:
        with self._database.reading() as db:
            return _user(db, name)

    def users(self) -> list[UserRecord]:
        with self._database.reading() as db:
            return [load_user(row) for row in db.execute("SELECT * FROM user ORDER BY name")]

    def update_user(self, user: UserRecord) -> None:
        with self._database.transaction() as db:
            _user(db, user.name)
            db.execute("UPDATE user SET password_hash = ?, role = ? WHERE name = ?", (user.password_hash, user.role, user.name))

    def remove_user(self, name: str) -> None:
        with self._database.transaction() as db:
            _user(db, name)
            db.execute("DELETE FROM token WHERE user = ?", (name,))
            db.execute("DELETE FROM user WHERE name = ?", (name,))

    def create_token(self, token: TokenRecord) -> None:
        with self._database.transaction() as db:
            _user(db, token.user)
            row = (token.id, token.user, token.title, token.role, token.digest)
            if db.execute(f"INSERT OR IGNORE INTO token VALUES (?, ?, ?, ?, ?, {NOW})", row).rowcount == 0:
                raise AlreadyExists(f"token {token.id}: exists already; create another one")

    def tokens(self, user: str | None = None) -> list[TokenRecord]:
        with self._database.reading() as db:
            return [load_token(row) for row in db.execute("SELECT * FROM token WHERE ?1 IS NULL OR user = ?1 ORDER BY id", (user,))]

    def find_token(self, digest: str) -> TokenRecord | None:
        with self._database.reading() as db:
            row = db.execute("SELECT * FROM token WHERE digest = ?", (digest,)).fetchone()
            return None if row is None else load_token(row)

    def remove_token(self, id: str) -> None:
        with self._database.transaction() as db:
            if db.execute("DELETE FROM token WHERE id = ?", (id,)).rowcount == 0:
                names = [row[0] for row in db.execute("SELECT id FROM token ORDER BY id LIMIT 21")]
                raise NotFound(f"no token {id!r}; existing tokens: {codec.list_names(names)}")


def _user(db: sqlite3.Connection, name: str) -> UserRecord:
    row = db.execute("SELECT * FROM user WHERE name = ?", (name,)).fetchone()
    if row is None:
        names = [row[0] for row in db.execute("SELECT name FROM user ORDER BY name LIMIT 21")]
        raise NotFound(f"no user {name!r}; existing users: {codec.list_names(names)}")
    return load_user(row)
