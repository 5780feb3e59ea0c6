"""Import reports in words."""

from dataclasses import dataclass

from map3d.catalogue import AssetRecord
from map3d.formats import title_of
from map3d.ingest.findings import findings
from map3d.web.pages.tools import translate as _


@dataclass(frozen=True)
class AssetRow:
    """An imported file in a list. `format`: the title of its format."""

    name: str
    source: str
    format: str
    objects: int
    triangles: int
    problems: int


def summary_of(asset: AssetRecord) -> AssetRow:
    report = asset.report
    problems = sum(found.count for found in findings(report))
    source = asset.source.rsplit("/", 1)[-1]
    return AssetRow(asset.name, source, title_of(asset.format), report.get("objects", 0), report.get("triangles", 0), problems)


def missing_files(asset: AssetRecord) -> list[str]:
    """Returns the names of the files that the document references and that were not beside it."""
    return list(asset.report.get("missing_files", ()))


def placing_words(asset: AssetRecord) -> str:
    """Returns how the coordinates came into the scene's system."""
    placing = asset.report.get("placing", {})
    source, target = placing.get("from"), placing.get("to")
    if not target:
        return ""
    if source in (None, target):
        return _("Coordinates: {target}, unchanged.", target=target)
    accuracy = placing.get("accuracy_m")
    exact = _("accuracy unknown") if accuracy is None or placing.get("ballpark") else _("accurate to {metres} m", metres=accuracy)
    return _("Coordinates: transformed from {source} to {target} ({exact}).", source=source, target=target, exact=exact)
