"""Lines about imports, for people: what the import reports of a scene warn about, and where on Earth the scene is."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

import click

from map3d.catalogue import Catalogue, Workspace
from map3d.errors import FAILED, IN_PART
from map3d.ingest.findings import Finding, findings, sum_findings

MAX_LINES: Final = 20


def warning_lines(reports: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yields a line for each finding in the reports (asset → report)."""
    named = (
        replace(found, example=f"{asset}: {found.example}" if found.example else asset)
        for asset, report in reports.items()
        for found in findings(report)
    )
    found = sum_findings(named)
    yield from map(str, found[:MAX_LINES])
    if len(found) > MAX_LINES:
        yield f"{len(found) - MAX_LINES} more kinds of warnings"


def missing_textures_line(reports: Mapping[str, Mapping[str, Any]]) -> str | None:
    """Returns e.g. "646 of 646 textures missing, e.g. town: ../textures/a.jpg"; None if none is missing."""
    counts = {asset: report["textures"] for asset, report in reports.items() if report.get("textures", {}).get("missing")}
    if not counts:
        return None
    missing = sum(count["missing"] for count in counts.values())
    images = sum(report.get("textures", {}).get("images", 0) for report in reports.values())
    asset = next(iter(counts))
    example = next(iter(reports[asset].get("missing_files", [])), "")
    return f"{missing:,} of {images:,} textures missing, e.g. {asset}: {example}; they must be in the given folder or below"


def asset_warning_lines(asset: str, report: Mapping[str, Any], limit: int = 8) -> Iterator[str]:
    """Yields a line for each of the first findings of one report."""
    if (line := missing_textures_line({asset: report})) is not None:
        yield line
    yield from (f"{asset}: {found}" for found in findings(report)[:limit])


def exit_for_files(failed: int, found: Iterable[Finding]) -> None:
    """Exits with FAILED if files could not be read, with IN_PART if some were not read as a whole."""
    if failed:
        raise click.exceptions.Exit(FAILED)
    if any(one.failed_file for one in found):
        raise click.exceptions.Exit(IN_PART)


def place_line(workspace: Workspace, catalogue: Catalogue, name: str) -> str | None:
    """Returns where the content of a scene is, e.g. "place: near Munich, Germany (48.137° N, 11.575° E), ETRS89 / UTM zone 32N"; None for a scene
    without any coordinates."""
    from map3d.ingest.content import content_centre
    from map3d.ingest.scene_crs import scene_place

    scene = catalogue.scene(name)
    if scene.crs is None:
        return None
    place = scene_place(scene, content_centre(workspace, catalogue, name))
    return f"place: unknown; coordinates in {scene.crs.name}" if place is None else f"place: {place}, {scene.crs.name}"
