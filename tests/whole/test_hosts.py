"""A published folder in a browser, from web servers as installed, and where it cannot open: the page is never empty."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from map3d_town.teatime import write_teatime
from tests.publish.hosts import PROGRAMS, web_host
from tests.whole.browsing import browse, command, picture

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("teatime")
    write_teatime(root / "files")
    subprocess.run(command("site", root / "files", "-o", root / "out", "-w", root / "workspace", "--res", "0.1", "--title", "Tea time"), check=True)
    return root / "out"


@contextmanager
def python_host(folder: Path) -> Iterator[str]:
    """Serves the folder with `python -m http.server`, which knows no ranges, and yields the address."""
    program = [sys.executable, "-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "--directory", str(folder)]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        assert server.stdout is not None
        try:
            yield f"http://127.0.0.1:{server.stdout.readline().split(' port ')[1].split()[0]}"
        finally:
            server.terminate()


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_map_opens_on_web_servers_as_installed(folder: Path, name: str) -> None:
    with web_host(name, folder) as address:
        found = browse("hosts.mjs", cases={name: {"address": f"{address}/", "picture": picture(f"host-{name}.png")}})
    assert found == {name: {"title": "Tea time", "sentence": None}}


def test_a_page_that_cannot_open_says_why_in_the_readers_language(folder: Path) -> None:
    with ExitStack() as servers:
        address = servers.enter_context(web_host("nginx", folder)) + "/"
        simple = servers.enter_context(python_host(folder)) + "/"
        text = {".js": "text/plain"}
        cases: dict[str, dict[str, Any]] = {
            "from disk": {"address": (folder / "index.html").as_uri()},
            "from disk, French": {"address": (folder / "index.html").as_uri(), "language": "fr-CH"},
            "no JavaScript": {"address": address, "javaScript": False},
            "old": {"address": address, "old": "DecompressionStream"},
            "old, German": {"address": address, "old": "ResizeObserver", "language": "de-AT", "size": [390, 844]},
            "modules refused": {"address": address, "types": {"page.js": "text/plain"}, "language": "it"},
            "core refused": {"address": address, "types": {"map3d.module.js": "text/plain"}},
            "no ranges": {"address": simple},
            "all scripts refused": {"address": address, "types": text},
        }
        for name, case in cases.items():
            case["picture"] = picture(f"closed-{name.replace(' ', '-').replace(',', '')}.png")
        found = browse("hosts.mjs", cases=cases)
    expected = {
        "from disk": "from a folder on disk",
        "from disk, French": "depuis un dossier du disque",
        "no JavaScript": "needs JavaScript",
        "old": "too old",
        "old, German": "zu alt",
        "modules refused": "didn’t load",
        "core refused": "didn’t load",
        "no ranges": "sends files only as a whole",
        "all scripts refused": "scripts didn’t load",
    }
    for name, sentence in expected.items():
        assert sentence in (found[name]["sentence"] or ""), (name, found[name])
