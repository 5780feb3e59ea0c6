"""What import reports name: parts of files that were skipped, and what was noted about others."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from map3d.messages import Message, message, table

MAX_NAMED_FILES: Final = 5
"""Files that a finding names."""

CONTRADICTIONS: Final = "contradictions"
"""Member of a report: what the check of coherence says of the file, which depends on the other files of the scene."""


@dataclass(frozen=True)
class Finding:
    """A reason that occurs `count` times. `example`: where it happened first."""

    reason: Message
    count: int
    example: str

    def __str__(self) -> str:
        return str(self.line)

    @property
    def message(self) -> Message:
        return Message(self.reason.code, {**self.reason.values, "count": self.count})

    @property
    def line(self) -> Message:
        return message("finding", finding=self.message, example=self.example) if self.example else self.message

    @property
    def document(self) -> dict[str, Any]:
        """The finding as JSON for programs, with its English text."""
        severity = self.reason.severity
        return {**self.reason.document, "severity": severity, "count": self.count, "example": self.example, "text": str(self.message)}

    @property
    def skipped(self) -> bool:
        """Whether elements with this fault are not in the scene, since they are broken or left out by design."""
        return self.reason.severity in ("skipped", "omitted")

    @property
    def whole_file(self) -> bool:
        """Whether it is said of files, which it counts."""
        return bool(table().get(self.reason.code, {}).get("whole_file"))

    @property
    def failed_file(self) -> bool:
        """Whether it is said of files that could not be read, or not as a whole."""
        return bool(table().get(self.reason.code, {}).get("failed_file"))

    @property
    def names_files(self) -> bool:
        """Whether it is said of files that people have to repair, the first of which are its example."""
        return bool(table().get(self.reason.code, {}).get("names_files"))

    def plus(self, other: "Finding") -> "Finding":
        """Returns the finding with what is said of other files too: the first example, or the first names."""
        examples = [text for text in (self.example, other.example) if text]
        kept = ", ".join(", ".join(examples).split(", ")[:MAX_NAMED_FILES]) if self.names_files else next(iter(examples), "")
        return replace(self, count=self.count + other.count, example=kept)

    @property
    def order(self) -> tuple[Any, ...]:
        """Sorts what is said of whole files first, then what was skipped, then by count."""
        return (not self.whole_file, not self.skipped, -self.count, str(self.reason))


def finding(code: str, count: int, example: str = "", **values: Any) -> dict[str, Any]:
    """Returns a finding as reports store it."""
    return {**message(code, **values).document, "count": count, "example": example}


def findings(report: Mapping[str, Any]) -> list[Finding]:
    """Returns the findings of a report, whole files first. A report of an older version of map3d has texts, which stay as they are."""
    items = [*report.get("findings", ()), *report.get(CONTRADICTIONS, ())]
    found = [Finding(Message(item["code"], item.get("values", {})), item["count"], str(item["example"])) for item in items]
    return sorted([*found, *_earlier(report)], key=lambda item: item.order)


def report_document(report: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a report for programs: the findings have their English text, also those of older reports."""
    rest = {name: value for name, value in report.items() if name not in ("skipped", "warnings", CONTRADICTIONS)}
    return {**rest, "findings": [item.document for item in findings(report)]}


def sum_findings(found: Iterable[Finding]) -> list[Finding]:
    """Returns the findings of several files together, with the first example of each, or the first names of files."""
    sums: dict[str, Finding] = {}
    for item in found:
        key = str(item.reason.document)
        sums[key] = sums[key].plus(item) if key in sums else item
    return sorted(sums.values(), key=lambda item: item.order)


def skipped_count(report: Mapping[str, Any]) -> int:
    return sum(item.count for item in findings(report) if item.skipped)


def warning_count(report: Mapping[str, Any]) -> int:
    return sum(item.count for item in findings(report) if not item.skipped)


def failed_count(report: Mapping[str, Any]) -> int:
    """Returns how many files of an asset, such as rasters of a terrain, could not be read, or not as a whole."""
    return sum(item.count for item in findings(report) if item.failed_file)


def _earlier(report: Mapping[str, Any]) -> Iterator[Finding]:
    skipped: Mapping[str, int] = report.get("skipped", {})
    examples = {item["reason"]: str(item["example"]) for item in report.get("warnings", ())}
    for reason, count in skipped.items():
        yield Finding(message("earlier-skipped", reason=reason), count, examples.get(f"skipped: {reason}", ""))
    for item in report.get("warnings", ()):
        if item["reason"].removeprefix("skipped: ") not in skipped:
            yield Finding(message("earlier-warning", reason=item["reason"]), item["count"], str(item["example"]))
