"""The memory for reading a CityGML file does not grow with the size of the file."""

from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from bench.large_citygml import WALLS, read_in_process, write_citygml

MIB = 1 << 20


@pytest.mark.parametrize("textured", [pytest.param(False, marks=pytest.mark.endurance), True])
def test_memory_is_flat_in_the_size_of_the_file(tmp_path: Path, textured: bool) -> None:
    small, large = (read_in_process(write_citygml(tmp_path / f"{size}.gml", size * MIB, textured)) for size in (4, 48))
    assert large.triangles % (2 * WALLS) == 0
    assert large.triangles > 10 * small.triangles
    assert large.bytes - small.bytes > 40 * MIB
    assert large.peak_bytes - small.peak_bytes < 8 * MIB, f"{small.peak_bytes / MIB:.0f} -> {large.peak_bytes / MIB:.0f} MiB"
