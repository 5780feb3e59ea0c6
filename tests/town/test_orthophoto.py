"""The orthophoto: GDAL reads it, at any size; memory is bounded."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio

from map3d_town import TownError, TownSpec
from map3d_town.layout.plan_town import plan_town
from map3d_town.textures.noise_patterns import PackedImage, pack_color
from map3d_town.writers.ground_rasters import OrthophotoRenderer, write_ortho
from map3d_town.writers.jpeg_geotiff import JpegTiff


def smooth(side: int) -> PackedImage:
    """Returns smooth gradients, which JPEG changes little."""
    y, x = np.mgrid[0:side, 0:side].astype(np.uint32)
    return np.asarray((x * 200 // side) | (y * 200 // side) << 8 | np.uint32(90 << 16), dtype="<u4")


def write(path: Path, picture: PackedImage) -> None:
    side = len(picture)
    with JpegTiff(path, side, 0.25, 25832, 690_000.0, 5_337_000.0) as out:
        for y in range(0, side, 1024):
            for x in range(0, side, 1024):
                out.write(x, y, picture[y : y + 1024, x : x + 1024])


@pytest.mark.parametrize("side", [1, 511, 512, 513, 1024, 1300])
@pytest.mark.parametrize("classic", [True, False])
def test_gdal_reads_the_written_image(side: int, classic: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not classic:
        monkeypatch.setattr("map3d_town.writers.jpeg_geotiff.CLASSIC_BYTES", 0)
    picture = smooth(side)
    write(tmp_path / "o.tif", picture)
    assert (tmp_path / "o.tif").read_bytes()[:4] == (b"II*\0" if classic else b"II+\0")
    with rasterio.open(tmp_path / "o.tif") as ortho:
        assert ortho.crs.to_epsg() == 25832
        assert ortho.bounds == (690_000.0, 5_337_000.0 - side * 0.25, 690_000.0 + side * 0.25, 5_337_000.0)
        assert (ortho.profile["compress"], ortho.profile["photometric"], ortho.profile["blockxsize"]) == ("jpeg", "ycbcr", 512)
        read = ortho.read().astype(int)
    expected = np.stack([picture >> shift & 255 for shift in (0, 8, 16)]).astype(int)
    assert np.abs(read - expected).max() <= 6


def test_tiles_may_be_written_in_any_order(tmp_path: Path) -> None:
    colors = [(200, 40, 40), (40, 200, 40), (40, 40, 200), (200, 200, 40)]
    with JpegTiff(tmp_path / "o.tif", 1024, 1.0, 25832, 0.0, 0.0) as out:
        for k in (2, 0, 3, 1):
            out.write(k % 2 * 512, k // 2 * 512, np.full((512, 512), pack_color(colors[k])))
    with rasterio.open(tmp_path / "o.tif") as ortho:
        seen = [ortho.read()[:, 256 + 512 * (k // 2), 256 + 512 * (k % 2)] for k in range(4)]
    assert np.abs(np.array(seen, dtype=int) - np.array(colors)).max() <= 4


def test_windows_join_without_a_seam() -> None:
    plan, _ = plan_town(TownSpec(buildings=20))
    renderer = OrthophotoRenderer(plan, 0.5)
    whole = renderer.render(0, 0, 256, 256)
    parts = [[renderer.render(x, y, 128, 128) for x in (0, 128)] for y in (0, 128)]
    same = whole == np.block(parts)
    assert same.mean() > 0.995, "pixels may differ only by rounding at the edges of windows"


def test_check_between_windows_may_raise(tmp_path: Path) -> None:
    plan, _ = plan_town(TownSpec(buildings=3))

    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_ortho(tmp_path / "o.tif", plan, 0.5, 600, 25832, 0.0, 0.0, stop)


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:4978"])
def test_crs_that_is_not_projected_raises(crs: str) -> None:
    with pytest.raises(TownError, match="projected"):
        _ = TownSpec(crs=crs).projected_epsg


def test_compound_crs_gives_its_horizontal_part() -> None:
    assert TownSpec(crs="EPSG:5555").projected_epsg == 25832


PEAK_MEMORY = """
import sys
from pathlib import Path
from map3d_town import TownSpec
from map3d_town.layout.plan_town import plan_town
from map3d_town.writers.ground_rasters import write_ortho
plan, _ = plan_town(TownSpec(buildings=40))
side = int(sys.argv[2])
write_ortho(Path(sys.argv[1]), plan, 2 * plan.radius_m / side, side, 25832, 0.0, 0.0, lambda: None)
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="needs /proc")
def test_memory_does_not_grow_with_the_orthophoto(tmp_path: Path) -> None:
    used = []
    for side in (2048, 8192):
        run = subprocess.run([sys.executable, "-c", PEAK_MEMORY, str(tmp_path / "o.tif"), str(side)], capture_output=True, text=True, check=True)
        used.append(int(run.stdout) / 1024)
    assert used[1] < used[0] + 24, f"MiB at 2048² and 8192²: {used}"
