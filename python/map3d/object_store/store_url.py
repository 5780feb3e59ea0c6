"""Opens an object store from its URL. URLs are stored and logged, so they must not contain credentials."""

from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

from map3d.errors import BadRequest
from map3d.object_store.contract import ObjectStore
from map3d.object_store.folder import FolderStore

CLOUD_SCHEMES: Final = ("s3", "gs", "az", "abfs", "abfss")


def check_store_url(url: str) -> str:
    """Returns the URL without a final slash. Raises BadRequest for an unknown scheme or a URL with credentials, which the message does not repeat."""
    parts = urlsplit(url)
    if "@" in parts.netloc or parts.query or parts.fragment:
        raise BadRequest(
            f"URL {_without_secrets(url)}: must contain no user, password, key or query; pass credentials in the environment (docs/stores.md)"
        )
    if parts.scheme not in ("file", *CLOUD_SCHEMES):
        raise BadRequest(f"URL {url!r}: unknown scheme; write file:///FOLDER or one of {', '.join(f'{name}://…' for name in CLOUD_SCHEMES)}")
    if parts.scheme == "file" and (parts.netloc not in ("", "localhost") or not parts.path.startswith("/")):
        raise BadRequest(f"URL {url!r}: write the folder's absolute path, as in file:///srv/tiles")
    if parts.scheme != "file" and not parts.netloc:
        raise BadRequest(f"URL {url!r}: missing the bucket or container, as in {parts.scheme}://BUCKET/PREFIX")
    return url.rstrip("/") if parts.path.strip("/") or parts.scheme != "file" else "file:///"


def open_object_store(url: str) -> ObjectStore:
    """Opens the store at a URL without contacting it. Credentials of clouds come from the environment: AWS_*, GOOGLE_*, AZURE_*.

    Raises BadRequest for an invalid URL, or when obstore, the extra `cloud`, is not installed.
    """
    checked = check_store_url(url)
    if checked.startswith("file:"):
        return FolderStore(file_path(checked))
    from map3d.object_store.cloud import CloudStore

    return CloudStore(checked)


def file_path(url: str) -> Path:
    """Returns the folder of a `file:` URL."""
    return Path(unquote(urlsplit(url).path))


def join_url(url: str, *names: str) -> str:
    """Appends names to a URL."""
    return "/".join([url.rstrip("/"), *names])


def _without_secrets(url: str) -> str:
    """Removes user, password, query and fragment."""
    parts = urlsplit(url)
    return parts._replace(netloc=parts.netloc.rpartition("@")[2], query="", fragment="").geturl()
