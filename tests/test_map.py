"""docs/map.md is that of the files, every file describes itself, and docs/architecture.md names files that exist."""

import importlib.util
import re
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


def test_the_architecture_names_files_that_exist() -> None:
    named = re.findall(r"`((?:crates|python|viewer|spec)/[\w./-]+)`", (DOCS / "architecture.md").read_text(encoding="utf-8"))
    assert len(named) > 30
    assert [name for name in named if not (ROOT / name).exists()] == []
