"""What an imported asset depends on: source files, options, and the version of the reader. If one of them changes, the file is imported again."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

from map3d.catalogue import AssetRecord
from map3d.errors import NotFound
from map3d.formats import find_format
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.sources import SourceDocument, source_digest

_REPORT_KEY: Final = "inputs"
VERSIONS_ON: Final = "versions_on"
"""An option of the reader, and in the report of a file some of whose objects have an end: the day that decides which of them have ended."""


@dataclass(frozen=True)
class ImportInputs:
    """`files`: digest of the source files; `options`: those that the reader of this format has; `reader`: its version."""

    files: str
    options: Mapping[str, Any]
    reader: int

    @property
    def digest(self) -> str:
        """Digest of everything: the `source_digest` of the asset."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:32]

    def report(self) -> dict[str, Any]:
        """Returns the part of an import report from which `changes` explains a later import."""
        return {_REPORT_KEY: asdict(self)}

    def of_last_import(self, asset: AssetRecord | None) -> dict[str, Any]:
        """Returns options of the reader that decided the last import of the same files: the day on which versions of objects were current."""
        before = {} if asset is None else asset.report
        if before.get(_REPORT_KEY, {}).get("files") != self.files or VERSIONS_ON not in before:
            return {}
        return {VERSIONS_ON: before[VERSIONS_ON]}

    def changes(self, asset: AssetRecord) -> str | None:
        """Returns why the asset has to be imported again, as the end of the sentence "imported again because …"; None when it is up to date."""
        if asset.source_digest == self.digest:
            return None
        before = asset.report.get(_REPORT_KEY)
        if before is None:
            return "an earlier version of map3d did not record its options"
        if before["files"] != self.files:
            return "the file changed"
        if before["reader"] != self.reader:
            return f"map3d reads its format in a new way (version {before['reader']} → {self.reader})"
        names = sorted({*before["options"], *self.options})
        return "of changed options: " + ", ".join(
            f"{name} ({_text(before['options'].get(name))} → {_text(self.options.get(name))})"
            for name in names
            if before["options"].get(name) != self.options.get(name)
        )


def import_inputs(source: SourceDocument, options: ImportOptions) -> ImportInputs:
    """Reads the source files. Raises NotFound for an unreadable one."""
    try:
        files = source_digest(source)
        limits = options.limits(source.data_paths, source.format)
    except OSError as error:
        raise NotFound(f"{error.filename or source.paths[0]}: cannot read the file: {error.strerror or error}") from error
    format = find_format(source.format)
    placing = {} if format.is_grouped else options.placing
    return ImportInputs(files, {"crs": options.crs, **placing, **options.reader_options(source.format, limits)}, format.version)


def _text(value: Any) -> str:
    return "none" if value is None else str(value)
