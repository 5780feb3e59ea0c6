"""Values that mean no height are found by their distance from all others, in elevation models that do not declare them."""

from pathlib import Path

import numpy as np
import pytest
import rasterio

from map3d.ingest.terrain.height_voids import find_void
from tests.ingest.terrain import rasters

HILLS = 500.0 + rasters.hills(60, 80)


def void_of(path: Path, heights: np.ndarray, **profile: float) -> float | None:
    with rasterio.open(rasters.write(path, heights, **profile)) as dataset:
        return find_void(dataset)


@pytest.mark.parametrize("value", [0.0, -9999.0, -32768.0, 32767.0, -99999.0])
def test_a_usual_value_far_from_all_others_means_no_height(tmp_path: Path, value: float) -> None:
    heights = HILLS.copy()
    heights[:, 10:20, 30:50] = value
    assert void_of(tmp_path / "a.tif", heights) == value
    assert void_of(tmp_path / "whole.tif", HILLS) is None
    assert void_of(tmp_path / "declared.tif", heights, nodata=value) is None


@pytest.mark.parametrize("least", [0.4, 30.0])
def test_the_sea_is_no_gap(tmp_path: Path, least: float) -> None:
    coast = np.maximum(rasters.hills(60, 80) * 20 + 100.0, 0.0)
    coast[(coast > 0.0) & (coast < least)] = least
    assert void_of(tmp_path / "a.tif", coast) is None


def test_other_values_far_from_the_rest_are_heights(tmp_path: Path) -> None:
    heights = HILLS.copy()
    heights[:, 10:20, 30:50] = 1234.5
    assert void_of(tmp_path / "a.tif", heights) is None
    assert void_of(tmp_path / "flat.tif", np.zeros((1, 20, 20), np.float32)) is None
