"""Every message, stage and log line that an operation can write has a sentence, and pages show it in their language."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from flask import Flask

import map3d
from map3d.ingest.import_progress import ImportProgress
from map3d.web.studio.operation_sentences import NUMBERS, SENTENCES, find_sentence, operation_text

PACKAGE = Path(map3d.__file__).parent
CRATES = PACKAGE.parents[1] / "crates"
MODULES = (
    "operations/do_import.py",
    "operations/do_removal.py",
    "operations/do_render.py",
    "operations/operation_report.py",
    "operations/operation_worker.py",
    "jobs/event_messages.py",
    "scenes/outlier_lines.py",
    "ingest/import_progress.py",
)
FUNCTIONS = {"catalogue/operation_records.py": ("expiry_message", "with_gaps")}
"""Modules and functions that write texts of operations."""

NOT_SHOWN = {
    "operation_worker.py": ("on_operation", "_error", "run"),
    "outlier_lines.py": ("place_text", "box_text", "length_text", "extent_text", "_count", "_file_text"),
    "do_removal.py": ("_renderings",),
    "import_progress.py": (),
}
"""Functions whose texts are for the command line, or parts of texts, which the sentences have as placeholders."""

WRITERS = ("progress", "log", "log_counted", "append_log", "_report")


def texts(path: Path, only: tuple[str, ...] | None = None) -> Iterator[list[str]]:
    """Yields the fixed parts of each text that the functions of a module return, yield, raise or pass to a log."""
    for function in (node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.FunctionDef)):
        if function.name in NOT_SHOWN.get(path.name, ()) or (only is not None and function.name not in only):
            continue
        for node in ast.walk(function):
            for part in written(node):
                yield from fixed_parts(part)


def written(node: ast.AST) -> Iterator[ast.expr]:
    if isinstance(node, ast.Return | ast.Yield) and node.value is not None:
        yield node.value
    elif isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
        yield from node.exc.args
    elif isinstance(node, ast.Call):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        yield from node.args if name in (*WRITERS, "LogLine") else ()
    elif isinstance(node, ast.Assign) and any(target in ast.unparse(node) for target in ("message, state =",)):
        yield node.value


def fixed_parts(node: ast.expr) -> Iterator[list[str]]:
    if isinstance(node, ast.JoinedStr):
        yield [part.value for part in node.values if isinstance(part, ast.Constant) and isinstance(part.value, str)]
    elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value:
        yield [node.value]
    elif isinstance(node, ast.IfExp):
        yield from [*fixed_parts(node.body), *fixed_parts(node.orelse)]
    elif isinstance(node, ast.Tuple | ast.List):
        yield from (found for part in node.elts for found in fixed_parts(part))
    elif isinstance(node, ast.GeneratorExp):
        yield from fixed_parts(node.elt)


def has_sentence(parts: list[str]) -> bool:
    """Whether the parts are, in this order, in a sentence."""
    if len(parts) == 1 and find_sentence(parts[0]) is not None:
        return True
    pattern = ".*".join(re.escape(part.strip()) for part in parts)
    return any(re.search(pattern, text) for text in SENTENCES)


@pytest.mark.parametrize("module", [*MODULES, *FUNCTIONS])
def test_every_text_of_operations_has_a_sentence(module: str) -> None:
    found = list(texts(PACKAGE / module, FUNCTIONS.get(module)))
    assert found
    assert [parts for parts in found if not has_sentence(parts)] == []


def test_a_text_without_a_sentence_is_found(tmp_path: Path) -> None:
    (tmp_path / "m.py").write_text('def do(report, n):\n    report.log(f"{n} things happened")\n    return "over" if n else f"{n} left"\n')
    assert [parts for parts in texts(tmp_path / "m.py") if not has_sentence(parts)] == [["over"], [" things happened"]]


def test_every_stage_of_the_core_has_a_sentence() -> None:
    sources = [path.read_text("utf-8") for crate in ("map3d-build", "map3d-texture") for path in (CRATES / crate / "src").rglob("*.rs")]
    stages = {stage for source in sources for stage in re.findall(r'\bprogress\)?\("(\w+)"', source)}
    assert stages >= {"chunks", "textures"}
    assert stages <= set(SENTENCES)


def test_every_count_of_a_build_has_a_sentence() -> None:
    report = (CRATES / "map3d-build" / "src" / "report.rs").read_text("utf-8")
    names = re.findall(r"pub (\w+): u64", report)
    assert names
    assert [name for name in names if find_sentence(f"7 {name.replace('_', ' ')}") is None] == []


def example(text: str) -> str:
    """Returns a text of the sentence."""
    counts = {"files": "2 files", "objects": "1 object", "triangles": "3 triangles", "elements": "4 elements", "blocks": "5 blocks"}
    values = {**counts, "images": "6 images", "last": "2 renderings", "numbers": "1 file", "stage": "rendering", "message": "cancelled"}
    words = dict.fromkeys(re.findall(r"{(\w+)}", text), "x")
    numbers = dict.fromkeys(NUMBERS, "1,234")
    return text.format(**{**words, **numbers, **values})


@pytest.mark.parametrize("text", SENTENCES)
def test_a_text_leads_to_its_sentence(text: str) -> None:
    found = find_sentence(example(text))
    assert found is not None
    assert found[0] == text


def german(text: str) -> str:
    with Flask(__name__).test_request_context(headers={"Accept-Language": "de"}):
        return operation_text(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("imported 4 files, 1,234 unchanged", "4 Dateien importiert, 1.234 unverändert"),
        ("house-1: 1 object, 12 triangles", "house-1: 1 Objekt, 12 Dreiecke"),
        ("built scene town: 1,200 triangles read, 4 chunks", "Szene town aufgebaut: 1.200 Dreiecke gelesen, 4 Chunks"),
        ("done: rendered 12 blocks, 480 images, 1,234.5 MB; complete (content version 1)",
         "fertig: 12 Blöcke gerendert, 480 Bilder, 1.234,5 MB; vollständig (Inhaltsversion 1)"),
        ("building: chunks", "Aufbau: Chunks"),
        ("importing dem.tif: 1,000 of 38,875 tiles, 150.5/s, 4 min left", "Import: dem.tif, 1.000 von 38.875 Kacheln, 150,5/s, noch 4 min"),
        ("importing a.gml: 50,000 triangles", "Import: a.gml, 50.000 Dreiecke"),
        ("cancelled while importing a.gml: 50,000 triangles", "abgebrochen bei: Import: a.gml, 50.000 Dreiecke"),
        ("removed scene town with 4 files, 1 rendering and 2 published folders, 0.5 MB",
         "Szene town entfernt, mit 4 Dateien, 1 Rendering und 2 veröffentlichte Ordner, 0,5 MB"),
        ("removed published/town, 3.0 MB", "published/town entfernt, 3 MB"),
        ("dem: Parts of the terrain outside the orthophoto or without data in it, in a plain colour: 12. Example: dem.tif",
         "dem: Teile des Geländes außerhalb des Orthofotos oder ohne Daten darin, in einer Farbe: 12. Beispiel: dem.tif"),
        ("a: Triangles without area, left out: 3. Example: b", "a: Weggelassene Dreiecke ohne Fläche: 3. Beispiel: b"),
        ("failed: a.obj: no usable triangle in the file; Triangles without area, left out: 1.",
         "fehlgeschlagen: a.obj: kein brauchbares Dreieck in der Datei; Weggelassene Dreiecke ohne Fläche: 1."),
        ("v 0/0/1: attempt 2 failed (the subprocess did not respond within 60 s); the block is now todo",
         "v 0/0/1: Versuch 2 fehlgeschlagen (Der Prozess antwortete nicht innerhalb von 60 s); Zustand des Blocks: zu rendern"),
        ("failed: the disk is full", "fehlgeschlagen: the disk is full"),
        ("something that no sentence has", "something that no sentence has"),
    ],
)  # fmt: skip
def test_pages_show_german(text: str, expected: str) -> None:
    assert german(text) == expected


def test_pages_in_english_show_the_text_as_it_is() -> None:
    with Flask(__name__).test_request_context(headers={"Accept-Language": "en"}):
        for text in SENTENCES:
            assert operation_text(example(text)) == example(text)


def test_german_sentences_differ_from_the_english_ones() -> None:
    translations = json.loads((PACKAGE / "web" / "translations" / "de.json").read_text("utf-8"))
    same = {text for text in SENTENCES if translations[text].lower() == text.lower()}
    assert same == {"chunks", "{count} chunks", "1 element", "1 block", "1 rendering", "{count} renderings", "{asset}: {objects}, {triangles}"}


def test_progress_of_terrain_has_a_sentence() -> None:
    progress = ImportProgress()
    assert find_sentence(progress.text({"done": 0, "total": 10})) is not None
    assert find_sentence(progress.text({"done": 5, "total": 10})) is not None
