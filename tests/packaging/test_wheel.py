"""The wheel in an empty environment: no Rust, no Node.js, no checkout on the path."""

import os
import re
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.wheel

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel() -> Path:
    wheels = sorted((ROOT / "dist").glob("map3d-*.whl"))
    if not wheels:
        pytest.skip("dist/ holds no wheel; `make wheel` builds it")
    return wheels[-1]


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment variables in which `map3d` is the installed wheel; PATH holds nothing but its own environment."""
    folder = tmp_path_factory.mktemp("wheel") / "venv"
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    install = [folder / "bin" / "python", "-m", "pip", "install", "-q", "--disable-pip-version-check"]
    subprocess.run([*install, "-c", ROOT / "requirements" / "run.lock", wheel], check=True)
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "MAP3D"))}
    return {**inherited, "PATH": str(folder / "bin"), "VIRTUAL_ENV": str(folder), "PYTHONUNBUFFERED": "1"}


@pytest.fixture
def demo(environment: dict[str, str], tmp_path: Path) -> Iterator[str]:
    """Yields the address that `map3d demo` prints."""
    command = [program(environment), "demo", "--folder", "demo", "--port", "0"]
    process = subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    lines = []
    try:
        for line in process.stdout:
            lines.append(line)
            if found := re.search(r"http://\S+/view/\w+", line):
                yield found[0]
                break
        else:
            pytest.fail("map3d demo ended without an address:\n" + "".join(lines))
    finally:
        process.terminate()
        process.communicate(timeout=30)


def test_wheel_is_abi3_manylinux_and_complete(wheel: Path) -> None:
    assert re.fullmatch(r"map3d-[\d.]+-cp311-abi3-manylinux_2_\d+_\w+\.whl", wheel.name)


def test_demo_serves_the_map_at_the_printed_address(demo: str) -> None:
    page = fetch(demo)
    assert b"map3d" in page
    assert len(fetch(demo.rstrip("/") + "/map3d.js")) > 50_000
    name = demo.rstrip("/").rsplit("/", 1)[1]
    assert b'"complete": true' in fetch(demo.split("/view/")[0] + f"/tiles/{name}/rendering.json").replace(b'":true', b'": true')


def test_site_publishes_a_folder_of_city_files(environment: dict[str, str], tmp_path: Path) -> None:
    run(environment, tmp_path, "make-town", "-o", "town", "--buildings", "6", "--no-trees")
    run(environment, tmp_path, "site", "town", "-o", "out")
    published = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"index.html", "map3d.js", "rendering.json"} <= published
    assert list((tmp_path / "out").rglob("*.pmtiles"))


def program(environment: dict[str, str]) -> str:
    return str(Path(environment["VIRTUAL_ENV"]) / "bin" / "map3d")


def run(environment: dict[str, str], folder: Path, *arguments: str) -> None:
    done = subprocess.run([program(environment), *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def fetch(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=30) as response:
        body: bytes = response.read()
    return body
