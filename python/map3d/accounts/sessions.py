"""Sessions as signed values of a cookie. The key of the signatures is a file of the workspace that only its owner reads."""

import hashlib
import hmac
import os
import secrets
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from itsdangerous import BadSignature, URLSafeTimedSerializer

from map3d.catalogue import UserRecord
from map3d.errors import StoreError

MAX_AGE_S: Final = 7 * 86_400
KEY_FILE: Final = "session.key"
_KEY_BYTES: Final = 32


@dataclass(frozen=True)
class Session:
    """`user`: empty before the sign-in. `password`: a digest of the user's password hash, so that a new password ends the session.
    `csrf`: the value that forms send back."""

    user: str
    password: str
    csrf: str

    def belongs_to(self, user: UserRecord | None) -> bool:
        return user is not None and hmac.compare_digest(self.password, _digest(user))

    def is_csrf(self, value: str) -> bool:
        return hmac.compare_digest(self.csrf.encode(), value.encode("utf-8", "replace"))


class Sessions:
    """Makes and reads the values of session cookies."""

    def __init__(self, folder: Path) -> None:
        self._serializer = URLSafeTimedSerializer(_read_key(folder / KEY_FILE), salt="map3d session")

    def start(self, user: UserRecord | None = None) -> Session:
        """Returns a new session: of the user, or one without a user for the sign-in form."""
        return Session("" if user is None else user.name, "" if user is None else _digest(user), secrets.token_urlsafe(24))

    def dump(self, session: Session) -> str:
        value = self._serializer.dumps(asdict(session))
        return value if isinstance(value, str) else value.decode()

    def load(self, text: str) -> Session | None:
        """Returns None for a value that is forged, damaged or too old."""
        try:
            return Session(**self._serializer.loads(text, max_age=MAX_AGE_S))
        except (BadSignature, TypeError, ValueError):
            return None


def _digest(user: UserRecord) -> str:
    return hashlib.sha256(user.password_hash.encode()).hexdigest()[:32]


def _read_key(path: Path) -> str:
    """Returns the key in the file, which is created on first use: complete from the start, and the same for all processes. Raises StoreError."""
    try:
        if not path.exists():
            _write_key(path)
        key = path.read_text("ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise StoreError(
            f"{path}: cannot read the key of sessions: {error}; correct the file's owner, or remove the file to end all sessions"
        ) from error
    if len(key) < _KEY_BYTES:
        raise StoreError(f"{path}: the key of sessions has {len(key)} characters, expected at least {_KEY_BYTES}; remove the file to create another")
    return key


def _write_key(path: Path) -> None:
    draft = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}")
    file = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(file, "w", encoding="ascii") as out:
            out.write(secrets.token_urlsafe(_KEY_BYTES) + "\n")
            out.flush()
            os.fsync(out.fileno())
        with suppress(FileExistsError):
            os.link(draft, path)
    finally:
        draft.unlink(missing_ok=True)
