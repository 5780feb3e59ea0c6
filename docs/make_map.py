"""`python docs/make_map.py`: writes docs/map.md, every source file with the first sentence of its own description."""

import re
import subprocess
from itertools import groupby
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
TARGET: Final = Path(__file__).with_name("map.md")
HEAD: Final = """# Map of the source

Written by `make docs` from the files themselves: folder → file → what it does. The README of a folder says what it may import and where to
start reading. [architecture.md](architecture.md) shows how they work together.
"""
FOLDERS: Final = ("crates", "python", "viewer/src", "viewer/page", "bench", "spec")
DESCRIPTIONS: Final = {
    ".rs": re.compile(r"\A(?:#!\[.*\]\n)*((?://!.*\n)+)"),
    ".py": re.compile(r'\A"""(.*?)(?:"""|\n\n)', re.DOTALL),
    ".ts": re.compile(r"/\*\*((?:(?!\*/).)*)\*/\n(?:@\w+.*\n)*export ", re.DOTALL),
}
"""A file's description: of the module in Rust and Python, of the first thing that it exports in TypeScript."""
README: Final = re.compile(r"^\* (.*)$", re.MULTILINE)
"""The description of a folder: the first item of its README."""
ROOTS: Final = ("README.md", "__init__.py", "mod.rs")
"""Files that describe their folder; the first counts."""
IN_README: Final = "lib.rs"
"""The file of a crate whose description is the first item of the crate's README."""


def source_files() -> list[Path]:
    """Returns the sorted relative paths of all source files and READMEs under version control, without tests."""
    listed = subprocess.run(["git", "ls-files", *FOLDERS], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    paths = (Path(line) for line in listed)
    return sorted(
        (
            path
            for path in paths
            if (path.suffix in DESCRIPTIONS or path.name == "README.md") and "tests" not in path.parts and not path.name.endswith(".d.ts")
        ),
        key=lambda path: (path.parent, path.name),
    )


def description(path: Path) -> str:
    """Returns the first sentence of a file's description; empty without one."""
    found = DESCRIPTIONS.get(path.suffix, README).search((ROOT / path).read_text(encoding="utf-8"))
    if found is None:
        return ""
    text = re.sub(r"\s+", " ", re.sub(r"^\s*(//!|\*)", "", found[1], flags=re.MULTILINE)).strip()
    return re.split(r"(?<=\.) (?=[A-Z`@])| @", text, maxsplit=1)[0].replace("|", "\\|")


def page() -> str:
    parts = [HEAD]
    for folder, files in groupby(source_files(), lambda path: path.parent):
        names = {path.name: description(path) for path in files}
        root = next((text for text in [names.pop(name, "") for name in ROOTS] if text), "")
        rows = [f"| `{name}` | {text} |" for name, text in names.items() if name != IN_README]
        table = "\n".join(["| file | |", "|---|---|", *rows]) if rows else ""
        parts.append("\n\n".join(part for part in (f"## [{folder}](../{folder})", root, table) if part) + "\n")
    return "\n".join(parts)


if __name__ == "__main__":
    TARGET.write_text(page(), encoding="utf-8")
    print(TARGET)
