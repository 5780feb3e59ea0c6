"""Import reports in words."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from map3d.catalogue import AssetRecord
from map3d.formats import title_of
from map3d.web.page_tools import translate as _
from map3d.web.report_sentences import fault_sentence, skip_sentence


@dataclass(frozen=True)
class ReportLine:
    """`severity`: skipped (something is missing in the map) or note. `example`: where it happened first."""

    severity: str
    text: str
    example: str = ""


@dataclass(frozen=True)
class AssetSummary:
    """An imported file in a list. `format`: the title of its format."""

    name: str
    source: str
    format: str
    objects: int
    triangles: int
    problems: int


def summary_of(asset: AssetRecord) -> AssetSummary:
    report = asset.report
    noted = sum(warning["count"] for warning in report.get("warnings", ()) if not warning["reason"].startswith("skipped: "))
    problems = sum(report.get("skipped", {}).values()) + noted
    source = asset.source.rsplit("/", 1)[-1]
    return AssetSummary(asset.name, source, title_of(asset.format), report.get("objects", 0), report.get("triangles", 0), problems)


def missing_files(asset: AssetRecord) -> list[str]:
    """Returns the names of the files that the document references and that were not beside it."""
    return list(asset.report.get("missing_files", ()))


def report_lines(asset: AssetRecord) -> list[ReportLine]:
    """Returns what was skipped, then what was noted; nothing for a file without problems."""
    return [*_skipped(asset.report), *_warnings(asset.report)]


def _skipped(report: Mapping[str, Any]) -> Iterator[ReportLine]:
    examples = {warning["reason"]: str(warning["example"]) for warning in report.get("warnings", ())}
    for reason, count in sorted(report.get("skipped", {}).items(), key=lambda item: -item[1]):
        yield ReportLine("skipped", _skipped_text(reason, count), examples.get(f"skipped: {reason}", ""))


def _skipped_text(reason: str, count: int) -> str:
    if (sentence := skip_sentence(reason)) is not None:
        return _(sentence[0], count=count, **sentence[1])
    return _("Skipped: {count} × {reason}.", count=count, reason=reason)


def _warnings(report: Mapping[str, Any]) -> Iterator[ReportLine]:
    for warning in report.get("warnings", ()):
        reason, count = warning["reason"], warning["count"]
        if not reason.startswith("skipped: "):
            yield ReportLine("note", _warning_text(reason, count), str(warning["example"]))


def _warning_text(reason: str, count: int) -> str:
    if (sentence := fault_sentence(reason)) is not None:
        return _(sentence[0], count=count, **sentence[1])
    return _("{count} × {reason}.", count=count, reason=reason)


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
