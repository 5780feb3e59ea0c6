"""The report of a site: stored with its rendering, published as a page that shows names as text."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.ingest.file_notes import unread
from map3d.ingest.findings import Finding
from map3d.messages import message
from map3d.publish.page_head import VIEWER_POLICY
from map3d.publish.report_page import report_files, report_page
from map3d.registry import ObjectKind
from map3d.scenes.file_contents import FileContents, Rasters, Textures
from map3d.site.report import SiteReport, read_report, write_report

BOX = ((0.0, 0.0, 1.0), (100.0, 50.0, 9.0))
HOSTILE = '<script src="https://evil.example/x.js"></script>&amp;"\'<img src=x onerror=alert(1)>'

TOWN = FileContents(
    asset="town",
    source="town.gml",
    format="citygml",
    rasters=None,
    bytes=12_345,
    crs="ETRS89 / UTM zone 32N",
    place="near Munich, Germany",
    box=BOX,
    kinds=(ObjectKind("building_part", "2", 1_234, 1_200),),
    triangles=56_789,
    outside=3,
    textures=Textures(646, 645, ("../textures/a.jpg",)),
    findings=(Finding(message("polygon-without-area"), 7, "house-1"), Finding(message("document-broken"), 1, "11.5 48.1")),
)
TERRAIN = replace(TOWN, asset="dem", source="a.tif", format="raster", rasters=Rasters(4, 1), textures=None, findings=(), outside=0)
REPORT = SiteReport(
    title="Town",
    crs="ETRS89 / UTM zone 32N",
    place="1, 2, near Munich, Germany",
    box=BOX,
    files=(TOWN, TERRAIN),
    failed=(("/data/cut.gml", "document broken at byte 17"),),
    ignored=(("town.json", unread("CityJSON")), ("a.jpg", message("used-as-texture", of="town.gml"))),
    left_out=("left out 3 triangles",),
    views=("45-45",),
    res_m=0.1,
    why="finer pixels show nothing more",
    workers=2,
    seconds=240.0,
)


class Elements(HTMLParser):
    """Collects the elements and the visible text of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.names: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.append(tag)
        self.attributes += attrs

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture
def stored(tmp_path: Path) -> Workspace:
    workspace = Workspace(tmp_path / "workspace")
    workspace.rendering_folder("town").mkdir(parents=True)
    return workspace


def test_a_stored_report_is_read_as_it_was_written(stored: Workspace) -> None:
    assert read_report(stored, "town") is None
    write_report(stored, "town", REPORT)
    assert read_report(stored, "town") == REPORT


def test_a_run_without_work_keeps_duration_and_reason() -> None:
    assert REPORT.with_run(None, None).seconds is None
    later = replace(REPORT, why="", workers=8)
    kept = later.with_run(None, REPORT)
    assert (kept.why, kept.seconds, kept.workers) == (REPORT.why, 240.0, 2)
    again = later.with_run(60.0, REPORT)
    assert (again.why, again.seconds, again.workers) == (REPORT.why, 60.0, 8)
    assert replace(later, res_m=0.2).with_run(None, REPORT).why == ""


def test_the_page_accounts_for_everything() -> None:
    text = Elements(report_page(REPORT, 4_000, 5_000_000)).text
    for expected in (
        "Town", "2 files imported 1 not imported", "2,468 objects", "113,578 triangles 7 elements skipped", "646 textures 645 missing",
        "4,000 tile images", "5.0 MB", "near Munich, Germany", "ETRS89 / UTM zone 32N", "100 m × 50 m, heights 1.0 to 9.0 m",
        "2,468 building part (LoD 2)", "0.1 m per pixel, since finer pixels show nothing more", "took 4 min with 2 workers",
        "Skipped polygons without area: 7.town.gml: house-1", "The file breaks off; what comes before is kept.town.gml: 11.5 48.1",
        "left out 3 triangles",
        "not importedcut.gmldocument broken at byte 17", "ignoredtown.jsonCityJSON", "useda.jpgtexture of town.gml",
        "CityGML, 12.3 kB", "dem (5 rasters)", "4 rasters of elevation and 1 raster of imagery",
        "3 triangles far from the rest", "../textures/a.jpg, …",
    ):  # fmt: skip
        assert expected in re.sub(r"\s+", " ", text), expected


def test_the_page_needs_no_network_and_runs_no_script() -> None:
    files = dict(report_files(REPORT, 1, 1, "preview.jpg"))
    assert sorted(files) == ["report.css", "report.html"]
    page = Elements(files["report.html"].decode())
    assert ("content", VIEWER_POLICY) in page.attributes
    assert not {"script", "style", "iframe"} & set(page.names)
    assert {value for name, value in page.attributes if name in ("href", "src")} == {"report.css", "favicon.ico", "preview.jpg", "index.html"}
    assert "style" not in {name for name, _ in page.attributes}
    assert b"url(" not in files["report.css"]
    assert b"@import" not in files["report.css"]


def test_names_from_files_are_text() -> None:
    """Each text that files determine contains markup; the elements are those of the harmless page."""
    findings = tuple(
        replace(finding, reason=message("part-crs-unusable", name=f"{finding.count} {HOSTILE}"), example=HOSTILE) for finding in TOWN.findings
    )
    kinds = (ObjectKind(HOSTILE, HOSTILE, 1_234, 1_200),)
    textures = Textures(646, 645, (HOSTILE,))
    town = replace(TOWN, asset=HOSTILE, source=HOSTILE, crs=HOSTILE, place=HOSTILE, kinds=kinds, textures=textures, findings=findings)
    hostile = replace(
        REPORT, title=HOSTILE, crs=HOSTILE, place=HOSTILE, files=(town, TERRAIN), failed=((HOSTILE, HOSTILE),),
        ignored=((HOSTILE, unread(HOSTILE)), (HOSTILE, message("left-backup", of=HOSTILE))), left_out=(HOSTILE,), why=HOSTILE,
    )  # fmt: skip
    page = Elements(report_page(hostile, 4_000, 5_000_000))
    assert page.names == Elements(report_page(REPORT, 4_000, 5_000_000)).names
    assert HOSTILE in page.text
    assert "onerror" not in {name for name, _ in page.attributes}


def test_a_map_without_problems_says_so() -> None:
    clean = replace(TOWN, findings=(), outside=0, textures=None)
    text = Elements(report_page(replace(REPORT, files=(clean,), failed=(), ignored=(), left_out=()), 1, 1)).text
    assert "Nothing in the imported files was skipped, and there are no warnings." in text
    assert "Files that are not in the map" not in text
    assert "Skipped" not in text
