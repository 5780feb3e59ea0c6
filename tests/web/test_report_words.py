"""Import reports are sentences in every language, whatever was skipped."""

import ast
import json
import re
from pathlib import Path

import pytest

import map3d.web
from map3d.catalogue import AssetRecord
from map3d.web import page_tools
from map3d.web.page_language import LANGUAGES
from map3d.web.report_sentences import FAULTS, FAULTS_BY_LIMIT, FAULTS_BY_NAME, SKIPPED, SKIPPED_BY_LIMIT, SKIPPED_BY_NAME, fault_sentence
from map3d.web.report_words import report_lines, summary_of

ROOT = Path(__file__).parents[2]
CALLS = re.compile(r"""\b(?:report|self)\.(?:skip|skip_many|omit)\(\s*(?:&format!\()?("[^"]*"|[A-Z_]{2,}|[a-z_.&()]+)""")
OF_VALUES = {"reason", "&reason", "error.reason()", "fault.reason()", "count", "reason,"}
"""What other functions return, whose reasons `reasons_of_functions` finds."""


def skip_reasons():
    """Returns every reason for which the readers and the writer of assets skip something, and how they begin where a limit follows."""
    sources = rust_sources()
    found = set()
    for text in sources.values():
        for call in CALLS.findall(text):
            if call.startswith('"'):
                found.add(call.strip('"'))
            elif call.isupper():
                found |= set(re.findall(rf'const {call}: &str = "([^"]*)"', "\n".join(sources.values())))
            else:
                assert call in OF_VALUES or "skip" in call, call
    of_python = {"grid points without a height", "implicit geometry without a place in the scene's coordinate system"}
    reasons = (found | reasons_of_functions(sources)) - {"RasterRelief: {}"}
    return {reason.replace(" = {limit}", "") for reason in reasons} | of_python


def reasons_of_functions(sources):
    texts = {path.name: text for path, text in sources.items()}
    triangulation = re.findall(r'Self::\w+ => "([^"]*)"', texts["polygon_error.rs"])
    geometry = re.findall(r'^ +\("([^"]*)", self\.\w+\),$', texts["validation.rs"], re.MULTILINE)
    implicit = re.findall(r'Err\("([^"]*)"\)', texts["implicit_geometry_parser.rs"])
    rings = re.findall(r'"(ring [^"]*)"(?:\.to_owned\(\)|\))', texts["tessellate.rs"])
    polygons = re.findall(r'=> Some\("([^"]*)"\)', texts["positions.rs"])
    tins = re.findall(r'Self::\w+ => "([^"]*)"', texts["tin.rs"])
    grids = re.findall(r'(?:Err|ok_or)\("(RasterRelief: [^"]*)"\)', texts["grid_parser.rs"])
    files = {f"RasterRelief: {reason}" for reason in re.findall(r'Self::\w+ => "([^"]*)"', texts["asset_folder.rs"])}
    assert min(map(len, (triangulation, geometry, implicit, rings, polygons, tins, grids, files))) >= 2
    return {*triangulation, *geometry, *implicit, *rings, *polygons, *tins, *grids, *files} - {"ring that is not closed"}


WARNING = re.compile(r"""\b(?:report|self)\.(?:warn|note|warn_file|note_file)\(\s*(?:&format!\()?("[^"]*"|[A-Z_]{2,}|[a-z_.&()]+)""")
WARNING_VALUES = {
    "reason": {"references.rs", "other_documents.rs", "text_input.rs", "geometry_parser.rs", "appearance_parser.rs", "converter.rs", "pre_scan.rs"},
    "oddity": {"images.rs", "mtl.rs", "grid_parser.rs"},
}
"""Variables that hold a reason, and the files that pass them on; `warning_reasons_of_functions` finds their values."""
PYTHON_VARIABLES = {
    ("raster_placement.py", "reason"),
    ("coordinate_check.py", "reason"),
    ("terrain_import.py", "reason"),
    ("document_reprojector.py", "reason"),
}
"""Variables of Python that hold a reason; `python_reasons` finds their values where they are assigned."""


def rust_sources():
    return {path: path.read_text("utf-8") for crate in ("map3d-read", "map3d-base") for path in (ROOT / "crates" / crate / "src").rglob("*.rs")}


def rust_warning_reasons():
    """Returns every reason for which the readers warn or note something; `{}` stands for what follows."""
    sources = rust_sources()
    everything, found = "\n".join(sources.values()), set()
    for path, text in sources.items():
        for call in WARNING.findall(text):
            if call.startswith('"'):
                found.add(call.strip('"'))
            elif call.isupper():
                (value,) = set(re.findall(rf'const {call}: &str =\s+"([^"]*)"', everything))
                found.add(value)
            else:
                assert path.name in {"report_builder.rs", *WARNING_VALUES.get(call, ())}, f"{path.name}: the reasons in {call} need a sentence"
    return (found | warning_reasons_of_functions({path.name: text for path, text in sources.items()})) - {"skipped: {reason}"}


def warning_reasons_of_functions(texts):
    of_files = re.findall(r'Self::\w+ => "([^"]*)"', texts["asset_folder.rs"])
    oddities = re.findall(r'Some\("([^"]*)"\)', texts["asset_folder.rs"])
    references = re.findall(r'"((?:reference into another|appearance in another) file: [^"]*)"', texts["references.rs"] + texts["other_documents.rs"])
    encodings = re.findall(r'reason: "([^"]*)"', texts["text_input.rs"])
    inspect = texts["images.rs"].partition("fn inspect(")[2].partition("\n}\n")[0]
    images = re.findall(r'(?:map_err\(\|_\| |ok_or\(|Err\(|format!\()"([^"]*)"', inspect)
    assert min(map(len, (of_files, oddities, references, encodings, images))) >= 3
    named = {f"{what}: {reason}" for what in ("image", "library object", "material library") for reason in of_files}
    return named | {f"image: {reason}" for reason in images} | {*oddities, *references, *encodings}


def python_reasons():
    """Returns every reason in warnings that Python adds to reports; `{}` stands for what a variable says."""
    found = set()
    for path in (ROOT / "python" / "map3d" / "ingest").rglob("*.py"):
        tree = ast.parse(path.read_text("utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Dict):
                values = [value for key, value in zip(node.keys, node.values, strict=True) if isinstance(key, ast.Constant) and key.value == "reason"]
            elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in ("_warn", "_warning"):
                values = node.args[:1]
            else:
                continue
            for value in values:
                found |= texts_of(value, tree, path.name)
    return {reason for reason in found if not reason.startswith("skipped: ")}


def texts_of(value, tree, file):
    if isinstance(value, ast.Constant):
        return {value.value}
    if isinstance(value, ast.JoinedStr):
        return {"".join(part.value if isinstance(part, ast.Constant) else "{}" for part in value.values)}
    assert isinstance(value, ast.Name), f"{file}, line {value.lineno}: write the reason as a text, or name a constant"
    assigned = [node for node in ast.walk(tree) if isinstance(node, ast.Assign | ast.AnnAssign) and value.id in map(ast.unparse, targets(node))]
    loops = [node.iter for node in ast.walk(tree) if isinstance(node, ast.For) and value.id in ast.unparse(node.target).strip("()").split(", ")]
    texts = [part for node in loops for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)]
    assert assigned or texts or (file, value.id) in PYTHON_VARIABLES, f"{file}, line {value.lineno}: where does {value.id} come from?"
    calls = [node.value for node in assigned if not isinstance(node.value, ast.Call | ast.Subscript | ast.Attribute)]
    return {text for part in [*calls, *texts] for text in texts_of(part, tree, file)}


def targets(node):
    return node.targets if isinstance(node, ast.Assign) else [node.target]


FOUND = {"axes swapped, so the file is read as {}": ("northing, easting", "longitude, latitude", "latitude, longitude")}
"""Values that have sentences of their own."""
OF_RASTERS = {"corners of the raster outside the area of use of {}"}
"""What `RasterPlacement` makes of a reason."""


def warning_reasons():
    return rust_warning_reasons() | python_reasons() | OF_RASTERS


def test_every_warning_has_a_sentence():
    reasons = warning_reasons()
    assert {"image: no pixels", "raster skipped", "the model seems to lie on its side", "points outside the area of use of {}"} <= reasons
    prefixes = {"image: {}", "image: {reason}", "library object: {}", "material library: {}"}
    missing = [reason for reason in reasons - prefixes for text in examples(reason) if fault_sentence(text) is None]
    assert missing == []


def examples(reason):
    """Returns reasons as reports have them."""
    if reason in FOUND:
        return [reason.format(value) for value in FOUND[reason]]
    return [re.sub(r"{.*?}", "12" if " = " in reason else "name", reason)]


def test_no_sentence_of_a_warning_is_left_over():
    said = {text for reason in warning_reasons() for text in examples(reason)}
    assert sorted(set(FAULTS) - said) == [], "nothing warns of this"
    assert [start for start in (*FAULTS_BY_LIMIT, *FAULTS_BY_NAME) if not any(text.startswith(start) for text in said)] == []


def test_every_skip_reason_has_a_sentence():
    reasons = skip_reasons()
    assert {"polygon with too many vertices to triangulate", "polygon that could not be triangulated", "points and lines"} <= reasons
    assert sorted(reasons - {*SKIPPED, *SKIPPED_BY_LIMIT}) == []
    assert sorted({*SKIPPED, *SKIPPED_BY_LIMIT} - reasons) == [], "nothing is skipped for this reason"


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_reason_is_said_in_every_language(monkeypatch, language):
    texts = {**FAULTS, **FAULTS_BY_LIMIT, **FAULTS_BY_NAME, **SKIPPED, **SKIPPED_BY_LIMIT, **SKIPPED_BY_NAME}
    translated = {} if language == "en" else json.loads((Path(map3d.web.__file__).parent / f"translations/{language}.json").read_text("utf-8"))
    assert language == "en" or sorted(set(texts.values()) - set(translated)) == []
    for module in (page_tools, map3d.web.page_formats):
        monkeypatch.setattr(module, "language", lambda: language)
    report = {
        "skipped": {
            **dict.fromkeys(SKIPPED, 1234),
            **{f"{reason} = 200000": 2 for reason in SKIPPED_BY_LIMIT},
            **{f"{reason} = EPSG:1234": 1234 for reason in SKIPPED_BY_NAME},
        },
        "warnings": [
            {"reason": reason, "count": 1234, "example": "b"}
            for reason in (*FAULTS, *(f"{start} = 200000" for start in FAULTS_BY_LIMIT), *(f"{start} EPSG:1234" for start in FAULTS_BY_NAME))
        ],
    }
    lines = [line.text for line in report_lines(AssetRecord("town", "a", "a.gml", "citygml", "d", "s", report))]
    number, limit = {"en": ("1,234", "200,000"), "de": ("1.234", "200.000")}[language]
    assert len(lines) == len(texts)
    assert [line for line in lines if not (number in line or limit in line)] == []
    assert [line for line in lines if "×" in line or "{" in line] == []


def test_an_unknown_reason_is_shown_as_it_is(monkeypatch):
    for module in (page_tools, map3d.web.page_formats):
        monkeypatch.setattr(module, "language", lambda: "de")
    (line,) = report_lines(AssetRecord("town", "a", "a.gml", "citygml", "d", "s", {"skipped": {"something = new": 3}}))
    assert line.text == "Übersprungen: 3 × something = new."


def test_what_is_skipped_counts_once():
    report = {"skipped": {"zero area": 3}, "warnings": [{"reason": "skipped: zero area", "count": 3}, {"reason": "unknown wrap mode", "count": 2}]}
    assert summary_of(AssetRecord("town", "a", "a.gml", "citygml", "d", "s", report)).problems == 5
