"""What import reports name, for tests."""

from map3d.messages import table


def skipped(report):
    """Returns the counts of what is not in the scene, by code."""
    return {item["code"]: item["count"] for item in report["findings"] if _is_skipped(item)}


def warned(report):
    """Returns the other findings."""
    return [item for item in report["findings"] if not _is_skipped(item)]


def _is_skipped(item):
    return table()[item["code"]]["severity"] in ("skipped", "omitted")
