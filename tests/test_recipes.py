"""docs/recipes.md names files and tests that exist, and the places of a recipe that no other test compares belong together."""

import json
import re
from pathlib import Path

import pytest
from bench.__main__ import PARTS

from map3d import messages, number_formats
from map3d.tiles import open_store
from map3d.web.pages.language import LANGUAGES

ROOT = Path(__file__).parents[1]


def read(path: str) -> str:
    return (ROOT / path).read_text("utf-8")


RECIPES = {text.partition("\n")[0]: text for text in re.split(r"^## ", read("docs/recipes.md"), flags=re.MULTILINE)[1:]}
NAMED = re.compile(r"`([\w.-]+(?:/[\w.-]+)+|[\w-]+\.(?:md|py)|Makefile|bench)(?:::(\w+))?`")
LINKS = re.compile(r"\]\(([\w./-]+)")


def test_there_are_ten_recipes() -> None:
    assert len(RECIPES) == 10


@pytest.mark.parametrize("title", RECIPES)
def test_a_recipe_names_files_and_tests_that_exist(title: str) -> None:
    named = NAMED.findall(RECIPES[title])
    assert [path for path, _ in named if not (ROOT / path).exists()] == []
    assert [link for link in LINKS.findall(RECIPES[title]) if not (ROOT / "docs" / link).exists()] == []
    assert [test for path, test in named if test and f"def {test}(" not in read(path)] == []
    tests = RECIPES[title].partition("\nTests: ")[2]
    assert re.search(r"`(?:tests|viewer/test|crates/[\w-]+/tests)/", tests)


def test_every_entry_is_complete() -> None:
    entries = re.findall(r"^  (\w+): ", read("viewer/scripts/entries.mjs"), re.MULTILINE)
    budgets = re.findall(r"^  (\w+): \d+,", read("viewer/scripts/size.mjs"), re.MULTILINE)
    readme = read("viewer/README.md")
    effects = {name for path in json.loads(read("viewer/package.json"))["sideEffects"] for name in re.findall(r"map3d-(\w+)\.module\.js", path)}
    assert set(budgets) == {"core", *entries, "full"}
    assert [name for name in entries if f"`map3d-{name}`" not in readme] == []
    registering = {name for name in entries if re.search(r"plugins\[|customElements", read(f"viewer/src/{name}/index.ts"))}
    assert effects == {*registering, "full"}


def test_all_parts_have_the_same_languages() -> None:
    rows = messages.table().values()
    spoken = set(number_formats.STYLES)
    assert all(spoken == set(row) - {"severity", "whole_file", "failed_file", "names_files"} for row in rows)
    translations = re.findall(r"interface Translations<T> \{(.*?)\n\}", read("viewer/src/core/i18n.ts"), re.DOTALL)[0]
    assert set(re.findall(r"readonly (\w+): T;", translations)) == spoken
    assert set(re.findall(r"(\w+): [A-Z]{2}\b", re.findall(r"const LANGUAGES.*", read("viewer/page/i18n.ts"))[0])) == spoken
    assert set(LANGUAGES) <= spoken


def test_every_tile_store_is_opened_and_tested() -> None:
    modules = [path.read_text("utf-8") for path in (ROOT / "python/map3d/tiles").glob("*.py")]
    stores = {name for text in modules if "def put_block(" in text for name in re.findall(r"^class (\w+TileStore):", text, re.MULTILINE)}
    assert stores >= {"SqliteTileStore", "ObjectTileStore"}
    assert all(hasattr(open_store, name) for name in stores)
    tested = read("tests/tiles/test_tile_store.py")
    assert [name for name in stores if name not in tested] == []


def test_every_kind_of_measurement_is_in_all_places() -> None:
    kinds = re.findall(r'"(\w+)"', re.findall(r"kind\?: (.*);", read("viewer/src/measure/measure.ts"))[0])
    assert re.findall(r'"(\w+)"', re.findall(r"const KINDS = (.*)", read("viewer/page/tools.ts"))[0]) == kinds
    assert re.findall(r'id="measure-(\w+)" data-i18n="\w+" aria-pressed', read("viewer/page/index.html")) == kinds
    assert [kind for kind in kinds if f"\n  {kind}Hint: " not in read("viewer/page/i18n.ts")] == []
    assert [kind for kind in kinds if f'| `"{kind}"` |' not in read("viewer/README.md")] == []


def test_every_benchmark_is_in_the_table_of_runs() -> None:
    runs = "\n".join(re.findall(r"^\| `(?:make bench|python -m bench).*$", read("docs/benchmarks.md"), re.MULTILINE))
    assert [part for part in PARTS if not re.search(rf"\b{part}\b", runs)] == []
