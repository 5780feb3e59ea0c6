"""Publications on web servers as installed and on an S3 server, read over HTTP by the reference readers of PMTiles in Python and JavaScript."""

import json
import shutil
import subprocess
from hashlib import sha256
from pathlib import Path

import httpx
import pytest
from pmtiles.reader import Reader

from map3d.object_store import open_object_store
from map3d.publish import publish
from tests.publish.hosts import PROGRAMS, public_address, web_host
from tests.web.workspaces import LAYERS, ZMAX, every_tile, tile_bytes

JAVASCRIPT_READER = Path(__file__).parents[2] / "viewer" / "node_modules" / "pmtiles" / "dist" / "esm" / "index.js"
MEDIA_TYPES = {".html": ["text/html"], ".css": ["text/css"], ".js": ["text/javascript", "application/javascript"], ".jpg": ["image/jpeg"]}
"""Suffix → media types that browsers accept. They read other files as bytes."""
EMPTY = [(ZMAX, 15, 0), (ZMAX + 1, 0, 0)]


@pytest.fixture(params=["nginx", "s3", *(pytest.param(name, marks=pytest.mark.third_party) for name in PROGRAMS if name != "nginx")])
def address(request, workspace, out):
    """The address of the published workspace on a static host."""
    if request.param in PROGRAMS:
        publish(workspace, "tea", out)
        with web_host(request.param, out) as host:
            yield host
        return
    endpoint, url = request.getfixturevalue("s3_endpoint"), request.getfixturevalue("s3_url")
    publish(workspace, "tea", url)
    yield public_address(endpoint, url, [name for name, _ in open_object_store(url).list()])


def archives_of(address):
    """Returns (view, layer) → URL, from the manifest on the host."""
    manifest = httpx.get(f"{address}/rendering.json").json()
    return {(view["id"], layer): f"{address}/{path}" for view in manifest["views"] for layer, path in view["archives"].items()}


def test_every_file_is_served_as_published(address):
    with httpx.Client(base_url=address) as client:
        lines = client.get("/checksums.sha256").text.splitlines()
        assert len(lines) > 15
        for line in lines:
            digest, name = line.split("  ")
            answer = client.get(f"/{name}")
            assert (answer.status_code, sha256(answer.content).hexdigest()) == (200, digest)
            wanted = MEDIA_TYPES.get(Path(name).suffix)
            assert wanted is None or answer.headers["content-type"].split(";")[0] in wanted, name


def test_a_part_of_an_archive_is_served(address):
    url = next(iter(archives_of(address).values()))
    whole = httpx.get(url).content
    for first, last in ((0, 0), (0, 126), (100, len(whole) - 1)):
        answer = httpx.get(url, headers={"Range": f"bytes={first}-{last}"})
        assert answer.status_code == 206
        assert answer.content == whole[first : last + 1]
        assert "content-encoding" not in answer.headers


def test_the_python_reader_reads_every_tile(address):
    archives = archives_of(address)
    assert len(archives) == 2 * len(LAYERS)
    with httpx.Client() as client:
        for (view, layer), url in archives.items():

            def part(offset, length, url=url):
                answer = client.get(url, headers={"Range": f"bytes={offset}-{offset + length - 1}"})
                assert answer.status_code == 206
                return answer.content

            reader = Reader(part)
            for tile in every_tile():
                assert reader.get(*tile) == tile_bytes(view, layer, tile)
            assert [reader.get(*tile) for tile in EMPTY] == [None] * len(EMPTY)


def test_the_javascript_reader_reads_every_tile(address):
    if shutil.which("node") is None or not JAVASCRIPT_READER.is_file():
        pytest.skip("the JavaScript reader of PMTiles is not installed: run npm ci in viewer/")
    tiles = [*every_tile(), *EMPTY]
    archives = archives_of(address)
    request = {"reader": str(JAVASCRIPT_READER), "archives": {url: [list(tile) for tile in tiles] for url in archives.values()}}
    script = Path(__file__).with_name("read_archives.mjs")
    done = subprocess.run(["node", str(script)], input=json.dumps(request), capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    for (view, layer), url in archives.items():
        expected = [sha256(tile_bytes(view, layer, tile)).hexdigest() for tile in every_tile()]
        assert found[url] == [*expected, *[None] * len(EMPTY)]
