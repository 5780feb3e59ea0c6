"""The table of CONTRIBUTING.md names files and folders that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROWS = [line for line in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").splitlines() if line.startswith("| ") and "?" in line]
PATH = re.compile(r"`([\w./-]+(?:/[\w.-]+|\.(?:rs|py|pyi|ts|mjs|json)))`|\]\(([\w./-]+)\)")


def find(name: str, folders: list[Path]) -> Path | None:
    """Returns the path below the root or below a folder that the row has named before."""
    return next((folder / name for folder in [*reversed(folders), ROOT] if (folder / name).exists()), None)


@pytest.mark.parametrize("row", ROWS, ids=[row.split("|")[1].strip() for row in ROWS])
def test_every_named_path_exists(row: str) -> None:
    names = [code or link for code, link in PATH.findall(row.rsplit("|", 2)[1])]
    folders: list[Path] = []
    for name in names:
        path = find(name, folders)
        assert path is not None, f"{name} is neither in the repository nor in a folder named before it"
        folders += [path] if path.is_dir() else [path.parent]


def test_the_table_is_read() -> None:
    assert len(ROWS) == 10
    assert sum(len(PATH.findall(row)) for row in ROWS) > 30
