"""Each source folder has a README of three items: what is there, what it may import, where to start reading."""

import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

from tests.test_map import load_make_map

ROOT = Path(__file__).parents[1]
PYTHON = sorted(path.parent for pattern in ("*", "*/*", "map3d/web/*") for path in (ROOT / "python").glob(f"{pattern}/__init__.py"))
PACKAGES = [path for path in PYTHON if path.parent.name != "map3d_town"]
CRATES = sorted(path.parent for path in (ROOT / "crates").glob("*/Cargo.toml"))
VIEWER = sorted(path for path in (ROOT / "viewer" / "src").iterdir() if path.is_dir())
FOLDERS = [*PACKAGES, *CRATES, *VIEWER, *(ROOT / name for name in ("viewer/page", "bench", "tests"))]
ENTRIES = set(re.findall(r"^  (\w+): ", (ROOT / "viewer/scripts/entries.mjs").read_text("utf-8"), re.MULTILINE))


def items(folder: Path) -> list[str]:
    return re.findall(r"^\* (.*)$", (folder / "README.md").read_text("utf-8"), re.MULTILINE)


def imports(folder: Path) -> set[str]:
    return set(re.findall(r"`([\w-]+)`", items(folder)[1]))


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


def floors(contract: str) -> list[set[str]]:
    """Returns the layers of a contract of import-linter, from the top; names without their package."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
    layers = next(one["layers"] for one in contracts if one["name"] == contract)
    return [{name.strip().rpartition(".")[2] for name in layer.split("|")} for layer in layers]


@pytest.fixture(scope="module")
def make_map() -> ModuleType:
    return load_make_map()


@pytest.mark.parametrize("folder", FOLDERS, ids=name_of)
def test_a_readme_has_three_items_and_names_files_that_exist(folder: Path) -> None:
    what, may_import, start = items(folder)
    assert what.endswith(".")
    assert "mport" in may_import
    assert start.startswith("Start with `")
    named = [*re.findall(r"`([\w./]+)`", start), *re.findall(r"\]\(([\w./-]+)(?:#[\w-]+)?\)", may_import + start)]
    assert [name for name in named if not (folder / name).exists() and not (ROOT / name).exists()] == []


@pytest.mark.parametrize("folder", [*PACKAGES, *CRATES, ROOT / "bench"], ids=name_of)
def test_a_readme_begins_as_the_package_describes_itself(folder: Path, make_map: ModuleType) -> None:
    root = folder / "src" / "lib.rs" if folder in CRATES else folder / "__init__.py"
    assert items(folder)[0] == make_map.description(root.relative_to(ROOT))


@pytest.mark.parametrize("folder", [ROOT / "viewer" / "src" / name for name in sorted(ENTRIES)], ids=name_of)
def test_the_readme_of_an_entry_begins_as_the_entry_describes_itself(folder: Path) -> None:
    assert (folder / "index.ts").read_text("utf-8").startswith(f"/** {items(folder)[0]}")


@pytest.mark.parametrize(
    ("contract", "parent"), [("Imports go down only", "python/map3d"), ("The HTTP front imports down only", "python/map3d/web")], ids=["map3d", "web"]
)
def test_packages_name_the_next_floor(contract: str, parent: str) -> None:
    layers = floors(contract)
    for layer, below in zip(layers, [*layers[1:], set()], strict=True):
        for folder in (ROOT / parent / name for name in layer if (ROOT / parent / name / "__init__.py").exists()):
            assert imports(folder) == below, folder


def test_every_package_is_on_a_floor() -> None:
    listed = set().union(*floors("Imports go down only"), *floors("The HTTP front imports down only"))
    assert {folder.name for folder in PACKAGES} - {"map3d", "map3d_town"} <= listed


@pytest.mark.parametrize("folder", CRATES, ids=name_of)
def test_crates_name_their_dependencies(folder: Path) -> None:
    dependencies = tomllib.loads((folder / "Cargo.toml").read_text("utf-8"))["dependencies"]
    assert imports(folder) == {name for name in dependencies if name.startswith("map3d-")}


def test_folders_of_the_viewer_name_those_below() -> None:
    lint = (ROOT / "viewer" / "eslint.config.js").read_text("utf-8")
    ranks = {name: int(rank) for name, rank in re.findall(r"(\w+): (\d)", re.findall(r"const RANKS = \{(.*?)\n\}", lint, re.DOTALL)[0])}
    seen_by_entries = set(re.findall(r'"(\w+)"', re.findall(r"const SEEN_BY_ENTRIES = (.*)", lint)[0]))
    assert {folder.name for folder in VIEWER} == (set(ranks) - {"map3d"}) | ENTRIES
    for folder in VIEWER:
        below = seen_by_entries if folder.name in ENTRIES else {name for name, rank in ranks.items() if rank < ranks[folder.name]}
        assert imports(folder) == below, folder
