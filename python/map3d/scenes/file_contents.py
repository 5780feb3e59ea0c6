"""What a scene has of each of its files: coordinate system, place, extent, objects by class, textures, and what was skipped."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from map3d.catalogue import AssetRecord, Catalogue, Workspace
from map3d.ingest.findings import Finding, findings, sum_findings
from map3d.registry import ObjectKind, Registry
from map3d.scenes.outliers import read_outliers
from map3d.types import Box, Vec3


@dataclass(frozen=True)
class Textures:
    """`images`: image files that the document names; `missing`: those not there; `examples`: names of the first of them."""

    images: int
    missing: int
    examples: tuple[str, ...] = ()


@dataclass(frozen=True)
class Rasters:
    """Numbers of elevation models and of images."""

    elevation: int
    imagery: int


@dataclass(frozen=True)
class FileContents:
    """`source`: name of the file, or of the first raster of a terrain, with folders where several have that name; `rasters`: their number, None for
    other formats. `crs`: name of the CRS of the coordinates in the file; `place`: where the file lies. `box`: world coordinates of the scene, None if
    empty. `outside`: triangles left out of a built scene, since they lie far from the rest. `bytes`: of the file at its import.

    `textures`: None for a file that names no images."""

    asset: str
    source: str
    format: str
    rasters: Rasters | None
    bytes: int
    crs: str | None
    place: str | None
    box: Box | None
    kinds: tuple[ObjectKind, ...]
    triangles: int
    outside: int
    textures: Textures | None
    findings: tuple[Finding, ...]

    @property
    def objects(self) -> int:
        return sum(kind.count for kind in self.kinds)

    @property
    def skipped(self) -> int:
        return sum(finding.count for finding in self.findings if finding.skipped)

    @property
    def warnings(self) -> int:
        return sum(finding.count for finding in self.findings if not finding.skipped)


def file_contents(workspace: Workspace, catalogue: Catalogue, scene: str) -> list[FileContents]:
    """Returns the files of a scene, in the order of their assets."""
    origin = catalogue.scene(scene).origin or (0.0, 0.0, 0.0)
    outside = {file.asset: file.triangles for file in read_outliers(workspace, scene).files}
    with Registry(workspace.registry_path(scene)) as registry:
        boxes = {name: _to_world(summary.box, origin) for name, summary in registry.asset_summaries().items()}
        kinds = registry.asset_kinds()
    assets = catalogue.assets(scene)
    labels = _labels([Path(asset.source) for asset in assets])
    return [
        replace(_contents(asset, boxes.get(asset.name), tuple(kinds.get(asset.name, ())), outside.get(asset.name, 0)), source=label)
        for asset, label in zip(assets, labels, strict=True)
    ]


def _labels(paths: Sequence[Path]) -> list[str]:
    """Returns the names of files, with as many of their folders as tell those of one name apart."""
    labels = {path: path.name for path in paths}
    for depth in range(2, max((len(path.parts) for path in labels), default=0) + 1):
        counts = Counter(labels.values())
        labels |= {path: "/".join(path.parts[-depth:]) for path, label in labels.items() if counts[label] > 1}
    return [labels[path] for path in paths]


def union(boxes: Sequence[Box | None]) -> Box | None:
    """Returns the box around boxes, or None if there are none."""
    known = [box for box in boxes if box is not None]
    if not known:
        return None
    low, high = (tuple(best(box[end][k] for box in known) for k in range(3)) for end, best in ((0, min), (1, max)))
    return ((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def file_label(file: FileContents) -> str:
    """Returns the name of the file; for several rasters the name of their terrain, with their number."""
    count = 0 if file.rasters is None else file.rasters.elevation + file.rasters.imagery
    return f"{file.asset} ({count:,} rasters)" if count > 1 else file.source


def sum_kinds(files: Sequence[FileContents]) -> list[ObjectKind]:
    """Returns the kinds of objects of all files together, the most frequent first."""
    found: dict[tuple[str, str | None], ObjectKind] = {}
    for kind in (kind for file in files for kind in file.kinds):
        before = found.get((kind.kind, kind.lod), ObjectKind(kind.kind, kind.lod, 0, 0))
        found[kind.kind, kind.lod] = replace(before, count=before.count + kind.count, drawn=before.drawn + kind.drawn)
    return sorted(found.values(), key=lambda kind: (-kind.count, kind.kind, kind.lod or ""))


def findings_of(files: Sequence[FileContents]) -> list[Finding]:
    """Returns the findings of all files together. The example names its file if there are several."""
    return sum_findings(
        replace(found, example=_named(found.example, file.source)) if len(files) > 1 and found.example else found
        for file in files
        for found in file.findings
    )


def _named(example: str, source: str) -> str:
    """Returns an example with the name of its file, which it may begin with."""
    return example if example.startswith(f"{source}: ") else f"{source}: {example}"


def _contents(asset: AssetRecord, box: Box | None, kinds: tuple[ObjectKind, ...], outside: int) -> FileContents:
    report = asset.report
    placing, rasters = report.get("placing", {}), report.get("rasters")
    return FileContents(
        asset=asset.name,
        source=report.get("first_raster") or Path(asset.source).name,
        format=asset.format,
        rasters=Rasters(rasters["elevation"], rasters["imagery"]) if rasters else None,
        bytes=report.get("bytes", 0),
        crs=placing.get("from"),
        place=placing.get("place"),
        box=box,
        kinds=kinds,
        triangles=report.get("triangles", 0),
        outside=outside,
        textures=_textures(report),
        findings=tuple(sum_findings(findings(report))),
    )


def _textures(report: Mapping[str, Any]) -> Textures | None:
    counts = report.get("textures")
    return None if counts is None else Textures(counts["images"], counts["missing"], tuple(report.get("missing_files", ())[:5]))


def _to_world(box: Box | None, origin: Vec3) -> Box | None:
    if box is None:
        return None
    low, high = ((corner[0] + origin[0], corner[1] + origin[1], corner[2] + origin[2]) for corner in box)
    return (low, high)
