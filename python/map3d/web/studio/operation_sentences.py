"""What operations report while they run and at their end, as sentences of pages.

Operations store their messages and logs in English, for programs and the command line. Pages find the sentence of a text here and translate it; texts
that are not here, such as the reason of an unusual error, stay as they are. tests/web/test_operation_sentences.py compares this list with the code.
"""

import re
from dataclasses import dataclass
from functools import cache
from typing import Final

from map3d.messages import table
from map3d.web.pages.formats import number_or_text
from map3d.web.pages.language import language
from map3d.web.pages.tools import translate as _

N_: Final = str
"""Marks a text that is translated where it is shown."""

STAGES: Final = (
    N_("starting"),
    N_("unpacking"),
    N_("unpacking {file}"),
    N_("importing {file}"),
    N_("importing {file}: {progress}"),
    N_("building: {stage}"),
    N_("planning"),
    N_("rendering"),
    N_("publishing {stage}"),
    N_("removing"),
    N_("sort"),
    N_("count"),
    N_("measure"),
    N_("chunks"),
    N_("textures"),
    N_("tiles"),
    N_("files"),
    N_("{done} of {total} tiles"),
    N_("{done} of {total} tiles, {rate}/s, {time} left"),
)
COUNTS: Final = (
    *(N_("1 file"), N_("{count} files"), N_("1 object"), N_("{count} objects"), N_("1 triangle"), N_("{count} triangles")),
    *(N_("1 element"), N_("{count} elements"), N_("1 block"), N_("{count} blocks"), N_("1 image"), N_("{count} images")),
    *(N_("1 rendering"), N_("{count} renderings"), N_("1 published folder"), N_("{count} published folders")),
)
BUILT: Final = (
    *(N_("{count} triangles read"), N_("{count} degenerate triangles"), N_("{count} duplicate faces"), N_("{count} duplicate vertices")),
    *(N_("{count} merged materials"), N_("{count} untextured faces"), N_("{count} split triangles"), N_("{count} ground plane triangles")),
    *(N_("{count} materials without their texture"), N_("{count} textures"), N_("{count} textures kept"), N_("{count} chunks")),
    *(N_("{count} chunks kept"), N_("{count} prototypes"), N_("{count} instances"), N_("{count} instances of nothing")),
    N_("{count} outlier triangles"),
)
"""Counts of a build that `COUNTS` does not have."""

WARNING: Final = N_("{asset}: {reason} Example: {example}")
LINES: Final = (
    N_("imported {files}, {unchanged} unchanged"),
    N_("imported {files}, {unchanged} unchanged, {failed} failed; the first: {reason}"),
    N_("{asset}: {objects}, {triangles}"),
    N_("{asset}: {objects}, {triangles}, skipped {elements}"),
    WARNING,
    N_("not imported: {reason}"),
    N_("and {count} more lines"),
    N_("and {count} more warnings"),
    N_("and {count} more files were not imported"),
    N_("built scene {scene}"),
    N_("built scene {scene}: {numbers}"),
    N_("scene {scene} is up to date"),
    N_("texture: {reason}: {example}"),
    N_("{blocks} to render: {added} new, {changed} changed"),
    N_("waiting for {blocks} that other workers render"),
    N_("{track} {block}: attempt {attempt} failed ({reason}); the block is now {state}"),
    N_("{track} {block}: lease lost: {reason}"),
    N_("files changed during the render"),
    N_("worker {worker} exited: {reason}"),
    N_("rendered {blocks}, {images}, {size} MB; complete (content version {version})"),
    N_("rendering {rendering} is incomplete: {blocks} in quarantine, {open} open; see the reasons, then render again with retry_quarantined"),
    N_("published to {folder}: {files}, {size} MB; {written} written, {removed} removed"),
    N_("folder {folder} was removed already"),
    N_("scene {scene} was removed already"),
    N_("rendering {rendering} was removed already"),
    N_("files {scene} was removed already"),
    N_("removed scene {scene} with {numbers} and {last}, {size} MB"),
    N_("removed rendering {rendering}, {size} MB"),
    N_("removed rendering {rendering} with {folders}, {size} MB"),
    N_("removed {files} from scene {scene}"),
    N_("removed {folder}, {size} MB"),
    N_("cancelled while {stage}"),
    N_("cancelled"),
    N_("done: {message}"),
    N_("failed: {message}"),
    N_("the worker died {count} times during this operation; fix the cause, then retry"),
    N_("… {count} lines are not kept …"),
    N_("{file}: two of the uploaded files have this name; import them one after another"),
)
JOB_STATES: Final = (N_("waiting"), N_("todo"), N_("leased"), N_("done"), N_("quarantined"))
"""States of a block after a failed attempt."""

REASONS: Final = (
    N_("{file}: no usable triangle in the file"),
    N_("{file}: no usable triangle in the file; {reason}"),
    N_("{file}: the parser crashed and nothing was imported: {reason}"),
    N_("{file}: cannot be unpacked: {reason}"),
    N_("the subprocess was ended by {signal} before it responded"),
    N_("the subprocess was ended by {signal} before it responded: {reason}"),
    N_("the subprocess ended with exit status {count} before it responded"),
    N_("the subprocess ended with exit status {count} before it responded: {reason}"),
    N_("the subprocess did not respond within {count} s"),
    N_("the subprocess reached its limit of {count} s of CPU time"),
)
"""Frequent reasons of failures, from imports and from the subprocesses that render."""

OUTLIERS: Final = (
    N_("left out {triangles} of {objects}, far from the rest:"),
    N_("  {source}: {triangles}, up to {distance} away: {names}"),
    N_("  and 1 more file"),
    N_("  and {count} more files"),
    N_("the files lie in {count} places far from each other:"),
    N_("the files lie in {count} places far from each other, all of which are kept:"),
    N_("  {count}: {objects}, {triangles}, {extent} around {place}; kept"),
    N_("  {count}: {objects}, {triangles}, {extent} around {place}; left out"),
    N_("  and 1 more place"),
    N_("  and {count} more places"),
    N_("--keep-outliers keeps everything (options of map3d site and create-rendering)"),
    N_("--keep-outliers keeps everything; --cluster {count} builds the place with that number instead (options of map3d site and create-rendering)"),
)
SENTENCES: Final = (*STAGES, *COUNTS, *BUILT, *LINES, *JOB_STATES, *REASONS, *OUTLIERS)

_NUMBER: Final = r"[\d,]+(?:\.\d+)?"
_COUNT: Final = r"[\d,]+ [a-z ]+"
_WORD: Final = r"\S+"
NUMBERS: Final = frozenset({
    *("count", "done", "total", "rate", "size", "version", "attempt"),
    *("unchanged", "failed", "added", "changed", "open", "written", "removed"),
})  # fmt: skip
_COUNTS: Final = frozenset({"files", "objects", "triangles", "elements", "blocks", "images", "last"})
_WORDS: Final = frozenset({"scene", "rendering", "folder", "track", "state", "signal"})
_TRANSLATED: Final = frozenset({"progress", "stage", "message", "reason", "state", *_COUNTS})
"""Placeholders of texts that have sentences of their own. `numbers` is a list of such texts."""


@dataclass(frozen=True)
class Sentence:
    """A sentence and the pattern of its texts."""

    text: str
    pattern: re.Pattern[str]

    @property
    def fixed(self) -> int:
        """The number of its characters that are not placeholders."""
        return len(re.sub(r"{\w+}", "", self.text))


def operation_text(text: str) -> str:
    """Returns a message or a line of a log in the language of the page."""
    return text if language() == "en" else _translated(text)


def find_sentence(text: str) -> tuple[str, dict[str, str]] | None:
    """Returns the sentence of an English text and what is in its placeholders. Of several, the one with the most characters counts."""
    for sentence in _sentences():
        if match := sentence.pattern.fullmatch(text):
            return sentence.text, match.groupdict()
    return None


@cache
def _sentences() -> tuple[Sentence, ...]:
    found = (Sentence(text, re.compile(_pattern(text), re.DOTALL)) for text in (*SENTENCES, *_findings()))
    return tuple(sorted(found, key=lambda sentence: -sentence.fixed))


@cache
def _findings() -> dict[str, dict[str, str]]:
    """Returns the texts of findings: English → language → text."""
    rows = [row for row in table().values() if row["severity"] in ("warning", "note", "skipped", "omitted") and "count" in str(row["en"])]
    return {
        row["en"] if number is None else row["en"][number]: {name: row[name] if number is None else row[name][number] for name in ("de", "fr")}
        for row in rows
        for number in ((None,) if isinstance(row["en"], str) else (0, 1))
    }


def _pattern(text: str) -> str:
    parts = re.split(r"{(\w+)}", text)
    return "".join(f"(?P<{part}>{_value_pattern(part)})" if number % 2 else re.escape(part) for number, part in enumerate(parts))


def _value_pattern(name: str) -> str:
    if name in NUMBERS:
        return _NUMBER
    if name in ("file", "asset"):
        return "[^:]+"
    return _COUNT if name in _COUNTS else _WORD if name in _WORDS else ".+?"


def _translated(text: str) -> str:
    found = find_sentence(text)
    if found is None:
        return text
    sentence, values = found
    if sentence in _findings():
        return _findings()[sentence][language()].format(**{name: number_or_text(_value(name, value)) for name, value in values.items()})
    return _(sentence, **{name: _value(name, value) for name, value in values.items()}) if values else _(sentence)


def _value(name: str, text: str) -> str | int | float:
    if name in NUMBERS:
        return _number(text)
    if name == "numbers":
        return ", ".join(map(_translated, text.split(", ")))
    return _translated(text) if name in _TRANSLATED else text


def _number(text: str) -> int | float:
    plain = text.replace(",", "")
    return float(plain) if "." in plain else int(plain)
