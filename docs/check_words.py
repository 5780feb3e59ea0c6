"""Fails when a word or phrase listed in docs/words.txt appears in a file of the repository."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
WORDS = Path(__file__).with_name("words.txt")
SKIPPED = {"docs/words.txt", "LICENSE", "viewer/LICENSE"}
SUFFIXES = {".py", ".pyi", ".rs", ".ts", ".mts", ".mjs", ".js", ".css", ".html", ".md", ".toml", ".json", ".sh", ".sql", ".txt", ".yml", ""}


def rules() -> Iterator[tuple[re.Pattern[str], str]]:
    """Yields (pattern, replacement) for each line of the list."""
    for line in WORDS.read_text().splitlines():
        if line and not line.startswith("#"):
            pattern, replacement = line.split("\t")
            yield re.compile(pattern), replacement


def files() -> Iterator[Path]:
    """Yields the text files that git tracks, without lock files and test vectors."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0")
    for name in names:
        path = ROOT / name
        generated = name in SKIPPED or name.endswith("-lock.json") or "vectors" in path.parts
        if path.suffix in SUFFIXES and not generated and path.is_file():
            yield path


def findings() -> Iterator[str]:
    """Yields one line per finding: file, line, words found, replacement."""
    listed = list(rules())
    for path in files():
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
            for pattern, replacement in listed:
                if found := pattern.search(line):
                    yield f"{path.relative_to(ROOT)}:{number}: {found[0]!r}; write: {replacement}"


def main() -> None:
    found = list(findings())
    print("\n".join(found))
    if found:
        sys.exit(f"{len(found)} retired words; docs/words.txt lists them")


if __name__ == "__main__":
    main()
