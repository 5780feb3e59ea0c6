"""Pages write numbers, sizes and times in their language; so do their scripts."""

import json
import os
import re
import shutil
import subprocess
from datetime import UTC, datetime
from html import unescape
from pathlib import Path

import pytest

import map3d.web
from map3d import number_formats
from map3d.catalogue import AssetRecord, PlannedJob, SceneCrs, SceneRecord
from map3d.catalogue.records import LOCAL_CRS_NAME
from map3d.operations.request_operation import request_operation
from map3d.types import BlockId
from map3d.web import create_app
from map3d.web.pages import tools
from map3d.web.pages.language import LANGUAGES
from tests.web.accounts import add_token, add_user
from tests.web.conftest import Client

WEB = Path(map3d.web.__file__).parent
NARROW, NO_BREAK = "\N{NARROW NO-BREAK SPACE}", "\N{NO-BREAK SPACE}"
WHEN = datetime(2026, 11, 23, 14, 5, tzinfo=UTC)
PUBLISHED_BYTES = 1_400_000_000

ROWS = [
    ("number", (1_234_567,), "1,234,567", "1.234.567", f"1{NARROW}234{NARROW}567"),
    ("number", (1234.5,), "1,234.5", "1.234,5", f"1{NARROW}234,5"),
    ("number", (0.0625,), "0.0625", "0,0625", "0,0625"),
    ("number", (-0.1 - 0.2,), "-0.3", "-0,3", "-0,3"),
    ("size", (0,), "0 bytes", "0 Byte", f"0{NO_BREAK}octet"),
    ("size", (14_200,), "14 kB", "14 kB", f"14{NARROW}ko"),
    ("size", (1.44e9,), "1.4 GB", f"1,4{NO_BREAK}GB", f"1,4{NARROW}Go"),
    ("size", (1.5e15,), "1,500.0 TB", "1.500,0 TB", f"1{NARROW}500,0{NARROW}To"),
    ("duration", (0.2,), "1 s", f"1{NO_BREAK}s", f"1{NARROW}s"),
    ("duration", (720,), "12 min", f"12{NO_BREAK}min", f"12{NARROW}min"),
    ("duration", (12_600,), "3.5 h", f"3,5{NO_BREAK}h", f"3,5{NARROW}h"),
    ("percent", (999, 1000), "99 %", f"99{NO_BREAK}%", f"99{NARROW}%"),
    ("metres", (0.2,), "0.2 m", f"0,2{NO_BREAK}m", f"0,2{NARROW}m"),
    ("distance", (3254,), "3.25 km", f"3,25{NO_BREAK}km", f"3,25{NARROW}km"),
    ("distance", (999_999,), "1,000 km", f"1.000{NO_BREAK}km", f"1{NARROW}000{NARROW}km"),
    ("distance", (1_200_000,), "1,200 km", f"1.200{NO_BREAK}km", f"1{NARROW}200{NARROW}km"),
    ("date", (WHEN,), "23 November 2026", "23. Nov. 2026", "23 nov. 2026"),
    ("moment", (WHEN,), "23 November 2026, 14:05 UTC", "23. Nov. 2026, 14:05 UTC", "23 nov. 2026, 14:05 UTC"),
    ("moment", (WHEN.timestamp(),), "23 November 2026, 14:05 UTC", "23. Nov. 2026, 14:05 UTC", "23 nov. 2026, 14:05 UTC"),
    ("moment", (None,), "–", "–", "–"),
]


@pytest.mark.parametrize(("name", "values", "english", "german", "french"), ROWS)
def test_every_format_in_every_language(name, values, english, german, french):
    for language, expected in (("en", english), ("de", german), ("fr", french)):
        assert getattr(number_formats, name)(*values, language) == expected, language


def test_every_language_of_pages_has_a_style():
    assert set(LANGUAGES) <= set(number_formats.STYLES)


@pytest.fixture
def filled(workspace):
    """The workspace with a file of many triangles, 3 planned blocks, a large published folder and a cancelled operation."""
    catalogue = workspace.open_catalogue()
    report = {
        "objects": 12_345,
        "triangles": 1_234_567,
        "findings": [{"code": "zero-area", "count": 2_345, "example": ""}],
        "placing": {"from": "A", "to": "B", "accuracy_m": 0.25},
    }
    catalogue.put_asset(AssetRecord("town", "houses", "houses.gml", "citygml", "d", "s", report))
    catalogue.plan("tea", [PlannedJob("0-45", BlockId(1, x, 0), "base", x, "k", None) for x in range(3)])
    asked = request_operation(workspace, catalogue, "render", "tea", {}, "anna")
    catalogue.cancel_operation(asked.id)
    catalogue.close()
    folder = workspace.root / "published" / "shown"
    folder.mkdir(parents=True)
    shutil.copy(workspace.manifest_path("tea"), folder)
    with (folder / "tiles.pmtiles").open("wb") as file:
        os.truncate(file.fileno(), PUBLISHED_BYTES)
    os.utime(workspace.manifest_path("tea"), (WHEN.timestamp(),) * 2)
    add_user(workspace)
    return workspace


@pytest.fixture
def pages(filled):
    client = Client(create_app(filled))
    headers = {"authorization": f"Bearer {add_token(filled)}", "accept": "text/html"}
    yield client, lambda path, language="en": unescape(client.get(path, headers={**headers, "accept-language": language}).text)
    client.close()


IN_PAGES = {
    "en": ("1,234,567 triangles", "area, left out: 2,345.", "accurate to 0.25 m", "1.4 GB", "23 November 2026, 14:05 UTC", "0.1 m"),
    "de": ("1.234.567 Dreiecke", "ohne Fläche: 2.345.", "auf 0,25 m genau", f"1,4{NO_BREAK}GB", "23. Nov. 2026, 14:05 UTC", f"0,1{NO_BREAK}m"),
}


@pytest.mark.parametrize("language", LANGUAGES)
def test_pages_write_numbers_sizes_and_dates_in_their_language(pages, language):
    _, get = pages
    triangles, skipped, accuracy, size, changed, resolution = IN_PAGES[language]
    report = get("/studio/scenes/town/files/houses", language)
    assert (triangles in report, skipped in report, accuracy in report) == (True, True, True)
    rendering = get("/studio/renderings/tea", language)
    assert (size in rendering, resolution in rendering) == (True, True)
    for path in ("/studio/renderings/tea/remove", "/studio/scenes/town/remove", "/studio/renderings/tea/published/shown/remove"):
        assert size in get(path, language), path
    assert changed in get("/renderings", language)


def test_the_list_of_renderings_errors_and_local_scenes_are_german(pages, filled):
    _, get = pages
    listed = get("/renderings", "de")
    assert "2 Ansichten · 4 Ebenen · " in listed
    assert "Vollständig" in listed
    assert 'title="Letzte Änderung: 23. Nov. 2026, 14:05 UTC">23. Nov. 2026<' in listed
    assert "nicht gefunden" in get("/studio/scenes/nothing", "de")
    filled.manifest_path("tea").unlink()
    assert "Noch nicht gerendert" in get("/renderings", "de")
    catalogue = filled.open_catalogue()
    catalogue.create_scene(SceneRecord("here", crs=SceneCrs(None, None, LOCAL_CRS_NAME)))
    catalogue.close()
    assert "lokale Meter" in get("/studio/scenes/here", "de")
    assert "lokale Meter" in get("/studio/", "de")


PATHS = (
    "/renderings",
    "/account",
    "/nothing",
    "/studio/",
    "/studio/operations/",
    "/studio/operations/1",
    "/studio/scenes/new",
    "/studio/scenes/town",
    "/studio/scenes/town/files/houses",
    "/studio/scenes/town/files/houses/remove",
    "/studio/scenes/town/remove",
    "/studio/scenes/town/renderings/new",
    "/studio/renderings/tea",
    "/studio/renderings/tea/remove",
    "/studio/renderings/tea/published/shown/remove",
)


def test_no_page_prints_a_number_without_a_filter(pages, monkeypatch):
    """Marks every number that a template prints as it is; only attributes and scripts may have such."""
    _, get = pages
    marked = tools.TEMPLATES.overlay(finalize=lambda value: f"⟦{value}⟧" if isinstance(value, int | float) and not isinstance(value, bool) else value)
    monkeypatch.setattr(tools, "TEMPLATES", marked)
    assert "⟦" in get("/studio/scenes/town/renderings/new") + get("/studio/renderings/tea"), "attributes have plain numbers"
    for path in PATHS:
        text = re.sub(r"<[^>]*>", " ", client_text(get, path))
        assert re.findall(r".{0,40}⟦[^⟧]*⟧.{0,40}", text) == [], path


def client_text(get, path):
    return re.sub(r"(?s)<script.*?</script>", "", get(path))


def test_templates_leave_numbers_to_filters():
    for path in WEB.glob("templates/**/*.html"):
        expressions = re.findall(r"{{(.*?)}}", path.read_text("utf-8"))
        assert [found for found in expressions if re.search(r"strftime(?!..%Y-%m-%dT)|//|\|round|\|int\b|\|filesizeformat", found)] == [], path.name


SCRIPT = """
import { readFileSync } from "node:fs";
import vm from "node:vm";
const found = {};
for (const lang of ["en", "de", "fr"]) {
  const context = vm.createContext({ document: { documentElement: { lang } }, Intl });
  vm.runInContext(readFileSync(process.argv[2], "utf8"), context);
  found[lang] = [context.numberText(1234567.5), context.sizeText(512), context.sizeText(14.2e6), context.timeText(30), context.timeText(12600)];
}
console.log(JSON.stringify(found));
"""


def test_scripts_write_numbers_in_the_language_of_the_page(tmp_path):
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs Node.js")
    script = tmp_path / "formats.mjs"
    script.write_text(SCRIPT, "utf-8")
    done = subprocess.run([node, script, WEB / "static" / "formats.js"], capture_output=True, text=True, check=True)
    found = {lang: [re.sub(r"\s", " ", text) for text in texts] for lang, texts in json.loads(done.stdout).items()}
    assert found == {
        "en": ["1,234,567.5", "512 bytes", "14.2 MB", "30 s", "3.5 h"],
        "de": ["1.234.567,5", "512 Byte", "14,2 MB", "30 s", "3,5 h"],
        "fr": ["1 234 567,5", "512 octets", "14,2 Mo", "30 s", "3,5 h"],
    }


def test_scripts_leave_numbers_to_formats():
    for path in WEB.glob("static/*.js"):
        if path.name != "formats.js":
            assert re.findall(r"toPrecision|toLocaleString|Intl\.|/ 1000\)?\.toFixed", path.read_text("utf-8")) == [], path.name
