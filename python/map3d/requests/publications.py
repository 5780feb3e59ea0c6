"""Requests about what leaves a workspace: publish, export."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from map3d.requests.param import Front, param
from map3d.types import ViewAngles

FOLDER_NAME: Final = "^[a-z0-9][a-z0-9_-]{0,63}$"
ExportFormat = Literal["mbtiles", "xyz", "dzi"]
EXPORT_FORMATS: Final[tuple[ExportFormat, ...]] = ("mbtiles", "xyz", "dzi")

_SERVER: Final[tuple[Front, ...]] = ("rest", "studio")
_LOCAL: Final[tuple[Front, ...]] = ("cli", "library")


def replace_param() -> Any:
    return param(
        False,
        help="Replace the published map of another rendering. That of the same rendering is updated without it.",
        label="Replace the map of another rendering in this folder",
    )


@dataclass(frozen=True, kw_only=True)
class Publish:
    """Writes a rendering as static files, or updates them."""

    out: str | None = param(
        None,
        help="Output folder, or the URL of an object store, e.g. s3://BUCKET/PREFIX.",
        option="-o/--out",
        metavar="FOLDER|URL",
        lacks=dict.fromkeys(_SERVER, "an editor chooses the name of a folder in the workspace"),
    )
    folder: str | None = param(
        None,
        help="Name of the folder in the workspace's folder published/.",
        words="the name of the rendering",
        pattern=FOLDER_NAME,
        label="Folder",
        lacks=dict.fromkeys(_LOCAL, "they name any folder or object store"),
    )
    replace: bool = replace_param()
    allow_incomplete: bool = param(False, help="Publish even if blocks are missing.", label="Publish even if blocks are missing")
    url: str | None = param(
        None,
        help="Address of the map's page, which links to it need to show its picture.",
        metavar="ADDRESS",
        label="Address of the map's page, for the picture of links",
    )
    gis: bool = param(
        False,
        help="Also write colour tiles as files, with layer definitions for QGIS and GDAL in the folder gis.",
        label="Also files for QGIS and GDAL",
    )
    max_file_bytes: int | None = param(
        None,
        help="Divide archives into files of at most this size, for hosts that limit it: 25M on Cloudflare Pages, 100M on GitHub Pages.",
        example="25M",
        words="whole archives",
        option="--max-file",
        minimum=1 << 20,
        is_size=True,
        label="Largest size of a file",
    )
    dry_run: bool = param(
        False,
        help="Print what would be written or sent, and its size, without doing so.",
        lacks=dict.fromkeys(_SERVER, "an operation has no other result than what it writes"),
    )


@dataclass(frozen=True, kw_only=True)
class Export:
    """Exports one view and layer for other software. Only the command line has it."""

    to: ExportFormat = param(help="MBTiles, a folder of z/x/y files, or a Deep Zoom Image.", choices=EXPORT_FORMATS)
    view: ViewAngles = param(help="Look-at angle and pitch.", example="45-22.5")
    layer: str = param("color", help="Layer to export.")
    out: Path = param(help="File NAME.mbtiles or NAME.dzi, or folder.", option="-o/--out")
