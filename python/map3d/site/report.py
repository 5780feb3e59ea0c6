"""The report of `map3d site`: what its files hold, what was not imported, the resolution and the cost. It stays with the rendering, for every
publication of it."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from map3d.catalogue import Workspace
from map3d.geometry.views import view_id
from map3d.ingest.file_notes import FileNote
from map3d.ingest.findings import Finding
from map3d.messages import load_message
from map3d.registry import ObjectKind
from map3d.scenes.file_contents import FileContents, Rasters, Textures
from map3d.types import Box, ViewAngles

FILE: Final = "site-report.json"
VERSION: Final = 2


@dataclass(frozen=True)
class SiteReport:
    """`place`: the middle of the scene and the nearest town; `failed`: (file, reason); `ignored`: files that are no documents of their own;
    `left_out`: lines about content far from the rest. `why`: reason of the resolution, empty when the user chose it; `seconds`: of the last run that
    rendered something, None before it."""

    title: str
    crs: str | None
    place: str
    box: Box | None
    files: tuple[FileContents, ...]
    failed: tuple[tuple[str, str], ...]
    ignored: tuple[FileNote, ...]
    left_out: tuple[str, ...]
    views: tuple[str, ...]
    res_m: float
    why: str
    workers: int
    seconds: float | None = None

    def with_run(self, seconds: float | None, previous: "SiteReport | None") -> "SiteReport":
        """Returns the report after a run; `seconds`: None when there was nothing to render. What only the first run of a rendering knows is the
        previous report's."""
        if previous is None or previous.res_m != self.res_m:
            return replace(self, seconds=seconds)
        why = self.why or previous.why
        if seconds is None:
            return replace(self, why=why, seconds=previous.seconds, workers=previous.workers)
        return replace(self, why=why, seconds=seconds)


def view_names(views: list[ViewAngles]) -> tuple[str, ...]:
    return tuple(view_id(view) for view in views)


def write_report(workspace: Workspace, rendering: str, report: SiteReport) -> None:
    path = _path(workspace, rendering)
    draft = path.with_name(f"{FILE}.new")
    draft.write_text(json.dumps({"version": VERSION, **asdict(report)}, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
    draft.replace(path)


def read_report(workspace: Workspace, rendering: str) -> SiteReport | None:
    """Returns None for a rendering that `map3d site` did not make, or made in another version of map3d."""
    try:
        value = json.loads(_path(workspace, rendering).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    return _parse(value) if value.pop("version") == VERSION else None


def _path(workspace: Workspace, rendering: str) -> Path:
    return workspace.rendering_folder(rendering) / FILE


def _parse(value: Mapping[str, Any]) -> SiteReport:
    pairs = {
        "failed": tuple((file, reason) for file, reason in value["failed"]),
        "ignored": tuple((file, load_message(note)) for file, note in value["ignored"]),
    }
    lists = {name: tuple(value[name]) for name in ("left_out", "views")}
    return SiteReport(**{**value, **pairs, **lists, "box": _parse_box(value["box"]), "files": tuple(map(_parse_file, value["files"]))})


def _parse_file(value: Mapping[str, Any]) -> FileContents:
    textures, rasters = value["textures"], value["rasters"]
    parts = {
        "box": _parse_box(value["box"]),
        "kinds": tuple(ObjectKind(**kind) for kind in value["kinds"]),
        "findings": tuple(Finding(load_message(item["reason"]), item["count"], item["example"]) for item in value["findings"]),
        "rasters": None if rasters is None else Rasters(**rasters),
        "textures": None if textures is None else Textures(textures["images"], textures["missing"], tuple(textures["examples"])),
    }
    return FileContents(**{**value, **parts})


def _parse_box(value: Any) -> Box | None:
    if value is None:
        return None
    low, high = value
    return ((low[0], low[1], low[2]), (high[0], high[1], high[2]))
