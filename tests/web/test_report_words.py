"""Import reports are sentences in every language, whatever was skipped."""

import json
import re
from pathlib import Path

import pytest

import map3d.web
from map3d.catalogue import AssetRecord
from map3d.web import page_tools
from map3d.web.page_language import LANGUAGES
from map3d.web.report_sentences import FAULTS, SKIPPED, SKIPPED_BY_LIMIT, SKIPPED_BY_NAME
from map3d.web.report_words import report_lines, summary_of

ROOT = Path(__file__).parents[2]
CALLS = re.compile(r"""\b(?:report|self)\.(?:skip|skip_many|omit)\(\s*(?:&format!\()?("[^"]*"|[A-Z_]{2,}|[a-z_.&()]+)""")
OF_VALUES = {"reason", "&reason", "error.reason()", "fault.reason()", "count", "reason,"}
"""What other functions return, whose reasons `reasons_of_functions` finds."""


def skip_reasons():
    """Returns every reason for which the readers and the writer of assets skip something, and how they begin where a limit follows."""
    sources = {path: path.read_text("utf-8") for crate in ("map3d-read", "map3d-base") for path in (ROOT / "crates" / crate / "src").rglob("*.rs")}
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
    return {reason.replace(" = {limit}", "") for reason in found | reasons_of_functions(sources)} | of_python


def reasons_of_functions(sources):
    texts = {path.name: text for path, text in sources.items()}
    triangulation = re.findall(r'Self::\w+ => "([^"]*)"', texts["triangulate.rs"])
    geometry = re.findall(r'^ +\("([^"]*)", self\.\w+\),$', texts["validation.rs"], re.MULTILINE)
    implicit = re.findall(r'Err\("([^"]*)"\)', texts["implicit_geometry.rs"])
    rings = re.findall(r'"(ring [^"]*)"(?:\.to_owned\(\)|\))', texts["tessellate.rs"])
    polygons = re.findall(r'=> Some\("([^"]*)"\)', texts["geometry_parser.rs"])
    tins = re.findall(r'Self::\w+ => "([^"]*)"', texts["tin.rs"])
    assert min(map(len, (triangulation, geometry, implicit, rings, polygons, tins))) >= 2
    return {*triangulation, *geometry, *implicit, *rings, *polygons, *tins} - {"ring that is not closed"}


def test_every_skip_reason_has_a_sentence():
    reasons = skip_reasons()
    assert {"polygon with too many vertices to triangulate", "polygon that could not be triangulated", "points and lines"} <= reasons
    assert sorted(reasons - {*SKIPPED, *SKIPPED_BY_LIMIT}) == []
    assert sorted({*SKIPPED, *SKIPPED_BY_LIMIT} - reasons) == [], "nothing is skipped for this reason"


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_reason_is_said_in_every_language(monkeypatch, language):
    texts = {**FAULTS, **SKIPPED, **SKIPPED_BY_LIMIT, **SKIPPED_BY_NAME}
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
        "warnings": [{"reason": reason, "count": 1234, "example": "b"} for reason in FAULTS],
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
