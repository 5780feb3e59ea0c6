"""Files of photogrammetry programs that say where an OBJ lies."""

from pathlib import Path

import pytest

from map3d.formats.model_place import ModelPlace, find_model_place

PRJ = 'PROJCS["ETRS89 / UTM zone 32N",AUTHORITY["EPSG","25832"]]'
METADATA = '<?xml version="1.0"?><ModelMetadata version="1"><SRS>{srs}</SRS><SRSOrigin>{origin}</SRSOrigin></ModelMetadata>'
MODEL = "a/house_simplified_3d_mesh.obj"
AT = (691000.0, 5336000.5, 12.0)


def place(folder: Path, files: dict[str, str], model: str = MODEL) -> ModelPlace | None:
    for name, text in {model: "v 0 0 0\n", **files}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return find_model_place(folder / model, folder)


OFFSETS = {
    "Pix4D": {"a/house_offset.xyz": "691000.000 5336000.500 12.000\n", "a/house_wkt.prj": PRJ},
    "parameters in a folder": {"params/house_offset.xyz": "691000, 5336000.5, 12", "params/house_wkt.prj": PRJ},
    "name of the whole model": {"a/house_simplified_3d_mesh_offset.xyz": "691000 5336000.5 12", "a/house_simplified_3d_mesh.prj": PRJ},
    "no name": {"a/offset.xyz": "(691000;5336000.5;12)", "a/wkt.prj": PRJ},
    "shift": {"a/house_global_shift.txt": "691000\t5336000.5\t12", "a/house.prj": PRJ},
}


@pytest.mark.parametrize("name", OFFSETS)
def test_an_offset_and_its_system_are_found(tmp_path: Path, name: str) -> None:
    found = place(tmp_path, OFFSETS[name])
    assert found is not None
    assert (found.offset, found.crs, {file.name for file in found.files}) == (AT, PRJ, {Path(file).name for file in OFFSETS[name]})


SYSTEMS = {
    "EPSG:25832": "EPSG:25832",
    "PROJCS[&quot;a&quot;]": 'PROJCS["a"]',
    "ENU:48.1,11.5": "+proj=aeqd +lat_0=48.1 +lon_0=11.5 +datum=WGS84 +units=m +no_defs +type=crs",
}


@pytest.mark.parametrize("srs", SYSTEMS)
@pytest.mark.parametrize("at", ["metadata.xml", "a/metadata.xml", "a/b/metadata.xml"])
def test_metadata_above_a_block_of_models_counts(tmp_path: Path, srs: str, at: str) -> None:
    found = place(tmp_path, {at: METADATA.format(srs=srs, origin="691000,5336000.5,12")}, "a/b/Tile_+000_+000.obj")
    assert found == ModelPlace(AT, SYSTEMS[srs], (tmp_path.resolve() / at,))


def test_metadata_outside_the_given_folder_does_not_count(tmp_path: Path) -> None:
    place(tmp_path, {"metadata.xml": METADATA.format(srs="EPSG:25832", origin="1,2,3")})
    assert find_model_place(tmp_path / MODEL) is None


@pytest.mark.parametrize("name", ["coords.txt", "odm_georeferencing_model_geo.txt"])
def test_the_place_of_opendronemap_is_for_georeferenced_models(tmp_path: Path, name: str) -> None:
    files = {f"odm_georeferencing/{name}": "WGS84 UTM 32N\n691000 5336000\n1 2 3\n"}
    found = place(tmp_path, files, "odm_texturing/odm_textured_model_geo.obj")
    assert found is not None
    assert (found.offset, found.crs) == ((691000.0, 5336000.0, 0.0), "EPSG:32632")
    assert place(tmp_path, files, "odm_texturing/odm_textured_model.obj") is None


def test_files_of_others_do_not_count(tmp_path: Path) -> None:
    assert place(tmp_path, {"a/garage_offset.xyz": "1 2 3", "a/ortho.prj": PRJ, "a/points.xyz": "1 2 3\n4 5 6\n"}) is None


@pytest.mark.parametrize("text", ["", "1 2 3\n4 5 6\n", "north", "1,5 2,5 3,5"])
def test_an_offset_that_is_none_is_named(tmp_path: Path, text: str) -> None:
    found = place(tmp_path, {"a/house_offset.xyz": text})
    assert found == ModelPlace(unreadable=tmp_path.resolve() / "a" / "house_offset.xyz")
