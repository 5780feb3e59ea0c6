"""docs/map.md is that of the files, every file describes itself, and docs/architecture.md names the floors of the linters and files that exist."""

import importlib.util
import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def load_make_map() -> ModuleType:
    """Returns the module docs/make_map.py."""
    spec = importlib.util.spec_from_file_location("make_map", DOCS / "make_map.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def make_map() -> ModuleType:
    return load_make_map()


def test_the_map_is_that_of_the_files(make_map: ModuleType) -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout")
    assert (DOCS / "map.md").read_text(encoding="utf-8") == make_map.page(), "run python docs/make_map.py"


def test_every_module_describes_itself(make_map: ModuleType) -> None:
    files = [path for path in make_map.source_files() if path.suffix in (".py", ".rs")]
    assert [str(path) for path in files if not make_map.description(path)] == []


@pytest.fixture(scope="module")
def architecture() -> str:
    return (DOCS / "architecture.md").read_text(encoding="utf-8")


def test_the_architecture_names_files_that_exist(architecture: str) -> None:
    named = re.findall(r"`((?:crates|python|viewer|spec)/[\w./-]+)`", architecture)
    assert len(named) > 30
    assert [name for name in named if not (ROOT / name).exists()] == []


def chain(floors: list[str]) -> str:
    """Returns the floors of a contract of import-linter as the architecture writes those of a folder."""
    names = [[name.strip().rpartition(".")[2] for name in floor.split("|")] for floor in floors]
    return " > ".join(one[0] if len(one) == 1 else f"{{{', '.join(one)}}}" for one in names)


def test_the_floors_are_those_of_the_linter(architecture: str) -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = {one["name"]: one.get("layers", []) for one in contracts}
    picture = re.findall(r"```text\n[^\n]*\n\n(.*?)```", architecture, re.DOTALL)[0]
    assert [re.split(r"\s{2,}", line.strip())[1] for line in picture.splitlines()] == [
        one.replace("map3d.", "") for one in layers["Imports go down only"]
    ]
    assert f"`{chain(layers['The HTTP front imports down only'])}`" in architecture


def test_the_crates_depend_on_each_other_as_drawn(architecture: str) -> None:
    below: dict[str, set[str]] = {}
    for upper, lower in reversed(re.findall(r"  (\w+) --> (\w+)", architecture)):
        below.setdefault(upper, set()).update({lower}, below.get(lower, set()))
    manifests = {path.parent.name.removeprefix("map3d-"): tomllib.loads(path.read_text()) for path in (ROOT / "crates").glob("*/Cargo.toml")}
    for name, manifest in manifests.items():
        used = {one.removeprefix("map3d-") for one in manifest["dependencies"] if one.startswith("map3d-")}
        assert used <= below.get(name, set()), f"{name} depends on {used - below.get(name, set())}"
    assert set(manifests) == {*below, "base"}
    assert "build" not in below["trace"]
