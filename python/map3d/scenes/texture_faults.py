"""Images that only decoding shows to be damaged: a build or an inspection finds them, and the reports of their files name them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from map3d import _core
from map3d.catalogue import AssetRecord, Catalogue, Workspace
from map3d.cores import usable_cores
from map3d.ingest.asset import write_report
from map3d.ingest.findings import MAX_NAMED_FILES

Faults = Mapping[str, Mapping[str, Any]]
"""Key of an image in assets → {"code", "values"}: the message that says why it is not drawn."""

_STAGE: Final = {"stage": "build"}


def report_texture_faults(workspace: Workspace, catalogue: Catalogue, scene: str, faults: Faults) -> None:
    """Adds the faults to the reports of the assets that have the images, in place of those of an earlier build."""
    for asset in catalogue.assets(scene):
        _report(catalogue, workspace.asset_folder(scene, asset.name), asset, faults)


def report_damaged_images(workspace: Workspace, catalogue: Catalogue, scene: str) -> None:
    """Decodes all images of a scene that is not built, and reports those that cannot be drawn."""
    for asset in catalogue.assets(scene):
        folder = workspace.asset_folder(scene, asset.name)
        _report(catalogue, folder, asset, json.loads(_core.find_damaged_images(str(folder), usable_cores())))


def _report(catalogue: Catalogue, folder: Path, asset: AssetRecord, faults: Faults) -> None:
    before = asset.report.get("findings", [])
    kept = [item for item in before if item.get("stage") != _STAGE["stage"]]
    if not faults and len(kept) == len(before):
        return
    findings = [*kept, *_findings(_image_names(folder), faults)]
    if findings != before:
        report = {**asset.report, "findings": findings}
        write_report(folder, report)
        catalogue.put_asset(replace(asset, report=report))


def _image_names(folder: Path) -> dict[str, str]:
    """Returns the images of an asset by key, with their names in the document as far as those are known."""
    known, images = folder / "images.json", folder / "textures"
    names: dict[str, str] = json.loads(known.read_text(encoding="utf-8")) if known.is_file() else {}
    return {path.stem: names.get(path.stem, path.name) for path in images.iterdir()} if images.is_dir() else {}


def _findings(names: Mapping[str, str], faults: Faults) -> list[dict[str, Any]]:
    by_message: dict[str, list[str]] = {}
    for key in sorted(names.keys() & faults.keys()):
        by_message.setdefault(json.dumps(faults[key], sort_keys=True), []).append(names[key])
    return [{**json.loads(text), "count": len(found), "example": _first(sorted(found)), **_STAGE} for text, found in by_message.items()]


def _first(names: Sequence[str]) -> str:
    return ", ".join(names[:MAX_NAMED_FILES])
