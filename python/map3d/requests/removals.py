"""Requests to remove: a scene, files of it, a rendering, a published folder."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from map3d.requests.param import param
from map3d.requests.publications import FOLDER_NAME

_BY_HAND: Final = "their folders stay, and are listed"


def _folders() -> Any:
    return param(
        None,
        help="Names of the published folders to remove too; the others stay. Needed if the renderings are published, even if the list is empty.",
        pattern=FOLDER_NAME,
        lacks={"cli": _BY_HAND, "library": _BY_HAND},
    )


@dataclass(frozen=True, kw_only=True)
class RemoveScene:
    with_renderings: bool = param(False, help="Remove its renderings too.", lacks={"studio": "the page names the renderings that go with the scene"})
    folders: tuple[str, ...] | None = _folders()


@dataclass(frozen=True, kw_only=True)
class RemoveFiles:
    names: tuple[str, ...] = param(help="Names of assets.", argument=True, minimum=1)


@dataclass(frozen=True, kw_only=True)
class RemoveRendering:
    folders: tuple[str, ...] | None = _folders()


@dataclass(frozen=True, kw_only=True)
class RemovePublished:
    folder: str = param(help="Name of the folder in the workspace's folder published/.", pattern=FOLDER_NAME)


REMOVALS: Final[Mapping[str, type]] = {"scene": RemoveScene, "files": RemoveFiles, "rendering": RemoveRendering, "published": RemovePublished}
"""What an operation removes → its request."""
