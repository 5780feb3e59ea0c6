"""Which of several rasters give heights and colours, and which is on top where they overlap."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from rasterio.enums import ColorInterp

from map3d.errors import BadRequest
from map3d.ingest.terrain.raster_choice import RasterChoice, choose_rasters, covered_share
from map3d.ingest.terrain.raster_dates import date_in_name
from map3d.ingest.terrain.raster_groups import split_far
from map3d.ingest.terrain.raster_mosaic import RasterMosaic
from map3d.ingest.terrain.raster_roles import find_roles
from tests.ingest.terrain.rasters import NORTH, WEST, colours, hills, write

GREY = np.full((1, 40, 40), 90, np.uint8)
NUMBERS = {"heights": lambda: hills(40, 40) + 500.0, "angles": lambda: aspect(40), "bytes": lambda: GREY, "rgb": lambda: colours(40, 40)}


def aspect(side: int) -> np.ndarray:
    """Returns directions of slopes, from 0 to 360."""
    y, x = np.gradient(hills(side, side)[0])
    return (np.degrees(np.arctan2(x, y)) % 360.0)[None].astype(np.float32)


def choose(folder: Path, *names: str, elevation: tuple[str, ...] = (), scene_height_m: float | None = None, **kinds: str) -> RasterChoice:
    """Writes rasters of one place, with the kind of content that `kinds` says of the stem of a name, else heights, and chooses among them."""
    paths = []
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        paths.append(write(path, NUMBERS[kinds.get(path.stem, "heights")]()))
    bounds, *_ = split_far(paths, None, "local")
    return choose_rasters(find_roles(paths, elevation, frozenset()), bounds, scene_height_m)


def used(choice: RasterChoice) -> tuple[list[str], list[str]]:
    return [path.name for path in choice.dems], [path.name for path in choice.orthos]


def codes(choice: RasterChoice) -> list[str]:
    return [item["code"] for item in choice.findings]


@pytest.mark.parametrize(
    "other",
    [
        "aspect.tif",
        "a_slope.tif",
        "SlopeDegrees.tif",
        "dem_slope.tif",
        "dgm1_neigung.tif",
        "pente.tif",
        "DSM.tif",
        "dom1.tif",
        "ndsm.tif",
        "aspect/1.tif",
    ],
)
def test_terrain_gives_the_heights_whatever_else_is_there(tmp_path: Path, other: str) -> None:
    choice = choose(tmp_path, other, "dem.tif")
    assert used(choice) == (["dem.tif"], [])
    assert codes(choice) == ["raster-not-used"]
    assert choice.findings[0]["example"].startswith(f"{Path(other).name}: ")
    assert "--elevation" in choice.findings[0]["example"]


@pytest.mark.parametrize("name", ["dtm.tif", "DGM1_690_5336.tif", "mnt.tif", "tile_1.tif", "swissALTI3D_2019.tif"])
def test_a_surface_gives_heights_only_where_no_other_does(tmp_path: Path, name: str) -> None:
    assert used(choose(tmp_path, "a_dsm.tif", name))[0] == [name]
    assert used(choose(tmp_path, "a_dsm.tif"))[0] == ["a_dsm.tif"]


def test_the_user_names_what_gives_heights(tmp_path: Path) -> None:
    assert used(choose(tmp_path, "dtm.tif", "DSM.tif", elevation=("DSM.tif",)))[0] == ["DSM.tif"]
    assert used(choose(tmp_path, "dtm.tif", "d/aspect.tif", elevation=("ASP*",)))[0] == ["aspect.tif"]
    assert used(choose(tmp_path, "dem.tif", elevation=("dem.tif",), dem="bytes")) == (["dem.tif"], [])
    with pytest.raises(BadRequest, match=r"--elevation gone\.tif: no raster has this name; there are dem\.tif"):
        choose(tmp_path, "dem.tif", elevation=("gone.tif",))


def test_the_unit_and_the_description_of_a_band_count(tmp_path: Path) -> None:
    degrees = write(tmp_path / "a.tif", aspect(40), units=["degree"])
    metres = write(tmp_path / "b.tif", hills(40, 40), units=["m"])
    bounds, *_ = split_far([degrees, metres], None, "local")
    assert used(choose_rasters(find_roles([degrees, metres], (), frozenset()), bounds, None))[0] == ["b.tif"]


@pytest.mark.parametrize(("scene_height_m", "why"), [(500.0, "far from those of the scene"), (None, "and rougher")])
def test_heights_that_contradict_each_other_are_told_apart_without_names(tmp_path: Path, scene_height_m: float | None, why: str) -> None:
    choice = choose(tmp_path, "1.tif", "2.tif", scene_height_m=scene_height_m, **{"1": "angles"})
    assert used(choice)[0] == ["2.tif"]
    assert (codes(choice), why in choice.findings[0]["example"]) == (["raster-not-used"], True)


def test_where_only_names_decide_the_user_is_asked(tmp_path: Path) -> None:
    one, two = (write(tmp_path / f"{name}.tif", hills(40, 40) + height) for name, height in (("1", 0.0), ("2", 900.0)))
    bounds, *_ = split_far([one, two], None, "local")
    choice = choose_rasters(find_roles([one, two], (), frozenset()), bounds, None)
    assert (used(choice)[0], codes(choice)) == (["1.tif"], ["raster-role-unclear"])
    assert "--elevation 2.tif uses it instead" in choice.findings[0]["example"]


def test_derived_rasters_alone_are_read_and_doubted(tmp_path: Path) -> None:
    choice = choose(tmp_path, "slope.tif")
    assert (used(choice)[0], codes(choice)) == (["slope.tif"], ["raster-role-unclear"])


def test_bytes_that_are_named_like_elevation_are_a_picture_and_doubted(tmp_path: Path) -> None:
    choice = choose(tmp_path, "dem.tif", dem="bytes")
    assert (used(choice), codes(choice)) == (([], ["dem.tif"]), ["raster-role-unclear"])
    assert codes(choose(tmp_path, "photo.tif", photo="bytes")) == []


@pytest.mark.parametrize("other", ["hillshade.tif", "band_4.tif", "dop_cir.tif"])
def test_colours_come_before_false_colours_bands_and_shadings(tmp_path: Path, other: str) -> None:
    kinds = {Path(other).stem: "rgb" if "cir" in other else "bytes", "z": "rgb"}
    choice = choose(tmp_path, other, "z.tif", **kinds)
    assert (used(choice)[1], codes(choice)) == (["z.tif"], ["raster-not-used"])
    assert used(choose(tmp_path, other, **kinds))[1] == [other]


def test_many_bands_are_a_picture(tmp_path: Path) -> None:
    bands = np.repeat(colours(8, 8)[:1].astype(np.uint16) * 12, 6, axis=0)
    path = write(tmp_path / "scan.tif", bands, colorinterp=[ColorInterp.undefined] * 6)
    assert [role.gives for role in find_roles([path], (), frozenset())] == ["colours"]


def test_tiles_side_by_side_are_all_used(tmp_path: Path) -> None:
    paths = [
        write(tmp_path / name, hills(40, 40), transform=Affine(1, 0, WEST + 40 * number, 0, -1, NORTH))
        for number, name in enumerate(("dtm_1.tif", "dsm_2.tif", "3.tif"))
    ]
    bounds, *_ = split_far(paths, None, "local")
    choice = choose_rasters(find_roles(paths, (), frozenset()), bounds, None)
    assert (choice.dems, choice.findings) == (paths, [])


def order(*rasters: Path, **options: Any) -> list[str]:
    """Returns the names of the parts of a mosaic, the uppermost first."""
    with RasterMosaic(rasters, None, **options) as mosaic:
        return [part.path.stem for part in reversed(mosaic.parts)]


def test_the_better_the_finer_and_the_newer_raster_is_on_top(tmp_path: Path) -> None:
    old, new, plain = (write(tmp_path / f"{name}.tif", colours(20, 20)) for name in ("dop_2019", "dop_2023-05", "a"))
    fine = write(tmp_path / "dop_2010.tif", colours(20, 20), pixel_m=0.5)
    assert order(old, new) == ["dop_2023-05", "dop_2019"]
    assert order(old, new, plain) == ["dop_2023-05", "dop_2019", "a"]
    assert order(old, new, fine) == ["dop_2010", "dop_2023-05", "dop_2019"]
    assert order(old, new, ranks={new: 1}) == ["dop_2019", "dop_2023-05"]


def test_dates_of_metadata_count_where_names_have_none(tmp_path: Path) -> None:
    import rasterio

    paths = [write(tmp_path / f"{name}.tif", colours(20, 20)) for name in ("a", "b")]
    for path, year in zip(paths, (2019, 2021), strict=True):
        with rasterio.open(path, "r+") as raster:
            raster.update_tags(TIFFTAG_DATETIME=f"{year}:05:01 12:00:00")
    assert order(*paths) == ["b", "a"]


@pytest.mark.parametrize(
    ("name", "date"),
    [("dop_2019.tif", "2019"), ("dop20190501.tif", "2019-05-01"), ("2021-06_x.tif", "2021-06"), ("690_5336.tif", ""), ("dgm_32690.tif", "")],
)
def test_dates_in_names(name: str, date: str) -> None:
    assert date_in_name(Path("tiles") / name) == date


def test_the_share_that_boxes_cover_together() -> None:
    box, others = (0.0, 0.0, 10.0, 10.0), np.array([(0.0, 0.0, 5.0, 10.0), (0.0, 0.0, 5.0, 5.0), (5.0, 0.0, 10.0, 5.0)])
    assert covered_share(box, others) == pytest.approx(0.75, abs=0.05)
    assert covered_share(box, np.empty((0, 4))) == 0.0
    assert covered_share((0.0, 0.0, np.inf, 10.0), others) == 0.0
