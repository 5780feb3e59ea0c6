"""Opens the catalogue that a URL names."""

import re
from pathlib import Path

from map3d.catalogue.catalogue_url import redact_url
from map3d.catalogue.contract import LEASE_S, Catalogue
from map3d.catalogue.sqlite import SqliteCatalogue
from map3d.errors import BadRequest

MONGODB_SCHEMES = ("mongodb", "mongodb+srv")


def open_catalogue(url: str, *, lease_s: float = LEASE_S, wait_s: float | None = None) -> Catalogue:
    """Opens `mongodb://HOST/DATABASE`, `sqlite:///FILE` or a path of an SQLite file. `wait_s`: how long a call may wait for the database.

    Raises BadRequest for other URLs and for MongoDB without pymongo, StoreError when the database cannot be reached.
    """
    scheme, separator, rest = url.partition("://")
    if not separator:
        return SqliteCatalogue(Path(url), lease_s=lease_s, wait_s=wait_s)
    if scheme == "sqlite" and rest.startswith("/"):
        return SqliteCatalogue(Path(re.sub("^/(?=/)", "", rest)), lease_s=lease_s, wait_s=wait_s)
    if scheme in MONGODB_SCHEMES:
        return _open_mongodb(url, lease_s, wait_s)
    raise BadRequest(f"{redact_url(url)}: is not the URL of a catalogue; write mongodb://HOST[:PORT]/DATABASE or sqlite:///FILE")


def is_networked(url: str) -> bool:
    """Whether several machines can open this catalogue."""
    return url.partition("://")[0] in MONGODB_SCHEMES


def _open_mongodb(url: str, lease_s: float, wait_s: float | None) -> Catalogue:
    try:
        from map3d.catalogue.mongodb import MongoCatalogue
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] not in ("pymongo", "bson"):
            raise
        raise BadRequest(f"{redact_url(url)}: a catalogue in MongoDB needs pymongo; install it with pip install 'map3d[mongodb]'") from None
    return MongoCatalogue(url, lease_s=lease_s, wait_s=wait_s)
