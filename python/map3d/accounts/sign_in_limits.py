"""Limits of failed sign-ins, by user name and by network address. All processes of a server share them, in a small SQLite file."""

from pathlib import Path
from typing import Final

from map3d.database import NOW, Database
from map3d.errors import Map3dError

FILE: Final = "sign-ins.sqlite"
WINDOW_S: Final = 900
MAX_PER_USER: Final = 10
MAX_PER_ADDRESS: Final = 30
MAX_ROWS: Final = 100_000

_SCHEMA: Final = "CREATE TABLE failure(subject TEXT NOT NULL, at REAL NOT NULL); CREATE INDEX failure_of ON failure(subject, at);"


class TooManySignIns(Map3dError):
    """Too many sign-ins failed; `retry_after_s` says when the next one is accepted."""

    def __init__(self, retry_after_s: int) -> None:
        super().__init__(f"too many failed sign-ins; try again in {max(1, round(retry_after_s / 60))} min")
        self.retry_after_s = retry_after_s


class SignInLimits:
    """Counts failures in a sliding window. A success clears those of the user, not those of the address."""

    def __init__(self, folder: Path, per_user: int = MAX_PER_USER, per_address: int = MAX_PER_ADDRESS) -> None:
        self._database = Database(folder / FILE, _SCHEMA, 1)
        self._per_user, self._per_address = per_user, per_address

    def take(self, user: str, address: str) -> None:
        """Counts an attempt as failed before its password is checked, so that parallel attempts cannot exceed a limit. Raises TooManySignIns."""
        limits = ((f"user {user[:64]}", self._per_user), (f"address {address[:64]}", self._per_address))
        with self._database.transaction() as db:
            db.execute(f"DELETE FROM failure WHERE at < {NOW} - {WINDOW_S}")
            for subject, limit in limits:
                count, wait_s = db.execute(f"SELECT count(*), min(at) + {WINDOW_S} - {NOW} FROM failure WHERE subject = ?", (subject,)).fetchone()
                if count >= limit:
                    raise TooManySignIns(max(1, round(wait_s)))
            if db.execute("SELECT count(*) FROM failure").fetchone()[0] >= MAX_ROWS:
                raise TooManySignIns(WINDOW_S)
            db.executemany(f"INSERT INTO failure VALUES (?, {NOW})", [(subject,) for subject, _ in limits])

    def succeeded(self, user: str, address: str) -> None:
        """Removes the user's failures and the attempt that `take` counted for the address."""
        with self._database.transaction() as db:
            db.execute("DELETE FROM failure WHERE subject = ?", (f"user {user[:64]}",))
            newest = "SELECT rowid FROM failure WHERE subject = ? ORDER BY at DESC LIMIT 1"
            db.execute(f"DELETE FROM failure WHERE rowid = ({newest})", (f"address {address[:64]}",))

    def close(self) -> None:
        self._database.close()
