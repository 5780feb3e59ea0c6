"""Messages have texts in all languages, with the same values; what an older version stored stays as it is."""

import json
from pathlib import Path
from string import Formatter

import pytest

from map3d.ingest.findings import findings, report_document, skipped_count, sum_findings, warning_count
from map3d.messages import FORMATS, Message, dump_text, load_message, load_text, message, table, verbatim
from map3d.number_formats import STYLES
from tests.web.test_page_formats import NARROW

NO_BREAK = "\N{NO-BREAK SPACE}"
SEVERITIES = {"error", "warning", "note", "skipped", "omitted", "progress", "done"}


def fields(text):
    return sorted((name, spec) for _, name, spec, _ in Formatter().parse(text) if name is not None)


def test_the_core_carries_the_specification():
    assert table() == json.loads((Path(__file__).parents[1] / "spec" / "messages.json").read_text("utf-8"))


@pytest.mark.parametrize("language", STYLES)
def test_every_text_is_in_every_language_with_the_same_values(language):
    for code, row in table().items():
        assert set(row) - {"whole_file", "failed_file", "names_files"} == {"severity", *STYLES}, code
        assert row["severity"] in SEVERITIES, code
        one, other = ([row[name]] if isinstance(row[name], str) else row[name] for name in ("en", language))
        assert [fields(text) for text in one] == [fields(text) for text in other], code
        assert all(spec in ("", *FORMATS, *table()) for text in one for _, spec in fields(text)), code


def test_a_text_has_the_values_as_its_language_writes_them():
    found = message("ring-over-limit", limit=200_000, count=1_234)
    assert str(found) == "Skipped rings with more than 200,000 points: 1,234."
    assert found.text("de") == "Übersprungene Ringe mit mehr als 200.000 Punkten: 1.234."
    assert f"200{NARROW}000" in found.text("fr")
    assert message("finding", finding=found, example="b").text("de").endswith("1.234. Beispiel: b")


def test_the_count_chooses_the_text():
    one, other = (message("document-broken", count=count) for count in (1, 2))
    assert (str(one), str(other)) == ("The file breaks off; what comes before is kept.", "Files that break off; what comes before is kept: 2.")


def test_a_message_is_the_same_after_json():
    nested = message("finding", finding=message("zero-area", count=3), example=[verbatim("x"), "y"])
    assert load_message(json.loads(json.dumps(nested.document))) == nested


def test_a_new_message_has_a_code_of_the_table_and_a_stored_one_may_not():
    with pytest.raises(KeyError):
        message("no-such-code")
    assert str(Message("no-such-code", {"a": 1})) == "no-such-code a=1"
    assert str(message("ring-over-limit", count=1)) == "ring-over-limit count=1"


@pytest.mark.parametrize("stored", ["failed: the disk is full", '{"a": 1}', "[]", "5", "{"])
def test_a_stored_text_stays_as_it_is(stored):
    assert load_text(stored).text("de") == load_message(stored).text("de") == stored


def test_a_catalogue_stores_a_message_as_text():
    nested = message("operation-failed", message=message("crs-missing"))
    assert load_text(dump_text(nested)) == nested
    assert (load_text(dump_text(None)), load_text(None)) == (None, None)


def test_a_message_knows_the_codes_and_texts_in_it():
    nested = message("imported-in-part", files=1, unchanged=0, failed=1, reason=message("about", what="/a/b.gml", message=message("crs-missing")))
    assert nested.codes == {"imported-in-part", "about", "crs-missing"}
    assert str(nested.map_texts(lambda text: text.replace("/a/", ""))).startswith(
        "imported 1 file, 0 unchanged, 1 failed; the first: b.gml: the file does not"
    )
    assert nested.named("message").keys() == {"message", "message_code", "message_values"}


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (message("imported", files=4, unchanged=1234), "4 Dateien importiert, 1.234 unverändert"),
        (message("imported-file", asset="house-1", objects=1, triangles=12), "house-1: 1 Objekt, 12 Dreiecke"),
        (
            message("built-counts", scene="town", counts=[message("built-triangles-read", count=1200), message("built-chunks", count=4)]),
            "Szene town aufgebaut: 1.200 Dreiecke gelesen, 4 Chunks",
        ),
        (
            message("operation-done", message=message("rendered", blocks=12, images=480, bytes=1_234_500_000, version=1)),
            f"fertig: 12 Blöcke gerendert, 480 Bilder, 1,2{NO_BREAK}GB; vollständig (Inhaltsversion 1)",
        ),
        (
            message("importing-progress", file="dem.tif", progress=message("tiles-done-with-rate", done=1000, total=38_875, rate=150.5, left=240.0)),
            f"Import: dem.tif, 1.000 von 38.875 Kacheln, 150,5/s, noch 4{NO_BREAK}min",
        ),
        (message("cancelled-while", stage=message("building-chunks")), "abgebrochen bei: Aufbau: Chunks"),
    ],
)
def test_operations_speak_german(said, expected):
    assert said.text("de") == expected


def test_an_older_report_is_shown_as_it_is():
    old = {
        "triangles": 5,
        "skipped": {"zero area": 2_345, "points and lines": 1},
        "warnings": [
            {"reason": "skipped: zero area", "count": 2_345, "example": "line 3"},
            {"reason": "document broken", "count": 1, "example": "at byte 9", "scope": "file"},
        ],
    }
    assert [str(found) for found in findings(old)] == [
        "2,345 × zero area. Example: line 3",
        "1 × points and lines.",
        "1 × document broken. Example: at byte 9",
    ]
    assert (skipped_count(old), warning_count(old)) == (2_346, 1)
    assert [item["text"] for item in report_document(old)["findings"]] == ["2,345 × zero area.", "1 × points and lines.", "1 × document broken."]


def test_findings_of_several_files_are_summed_by_code_and_values():
    report = {
        "findings": [
            {"code": "ring-over-limit", "values": {"limit": 9}, "count": 1, "example": ""},
            {"code": "document-broken", "count": 1, "example": "here"},
        ]
    }
    assert [str(found) for found in sum_findings([*findings(report), *findings(report)])] == [
        "Files that break off; what comes before is kept: 2. Example: here",
        "Skipped rings with more than 9 points: 2.",
    ]
