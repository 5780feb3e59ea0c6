"""An asset is out of date when its files, its options or the reader's version changed, and map3d says which."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import AssetRecord, SceneRecord, Workspace
from map3d.errors import NotFound
from map3d.formats import CITYGML, FORMATS
from map3d.ingest.import_inputs import import_inputs
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import import_file
from map3d.ingest.sources import find_sources, source_digest
from tests.ingest.terrain.rasters import write

OBJ = "v 0 0 0\nv 2 0 0\nv 2 3 0\nf 1 2 3\n"
GML = """<?xml version="1.0"?>
<CityModel xmlns="http://www.opengis.net/citygml/2.0" xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
  xmlns:gml="http://www.opengis.net/gml"><cityObjectMember><bldg:Building gml:id="b"><bldg:lod1Solid><gml:Solid><gml:exterior><gml:CompositeSurface>
  <gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList srsDimension="3">0 0 0 5 0 0 5 5 2 0 5 2 0 0 0</gml:posList>
  </gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember></gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod1Solid>
  </bldg:Building></cityObjectMember></CityModel>"""


def imported(tmp_path: Path, path: Path, options: ImportOptions) -> AssetRecord:
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    if not catalogue.scenes():
        catalogue.create_scene(SceneRecord("town"))
    import_file(workspace, catalogue, "town", find_sources([path])[0], options)
    (asset,) = (asset for asset in catalogue.assets("town") if asset.name == find_sources([path])[0].name)
    catalogue.close()
    return asset


def changes(asset: AssetRecord, path: Path, options: ImportOptions) -> str | None:
    return import_inputs(find_sources([path])[0], options).changes(asset)


def test_unchanged_files_and_options_are_up_to_date(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(OBJ)
    asset = imported(tmp_path, path, ImportOptions(crs="local"))
    assert changes(asset, path, ImportOptions(crs="local")) is None
    assert changes(asset, path, ImportOptions(crs="local", theme="summer", lod="2", parse_cpu_s=7)) is None, "OBJ has neither theme nor LoD"
    report = json.loads((tmp_path / "workspace/scenes/town/assets/a/report.json").read_text())
    assert report["inputs"] == asset.report["inputs"], "an import that is completed after a kill records them too"


@pytest.mark.parametrize(
    ("option", "text"),
    [({"crs": "EPSG:25832"}, "crs (local → EPSG:25832)"), ({"up": "y"}, "up (z → y)"), ({"strict": True}, "strict (False → True)")],
)
def test_changed_options_of_the_format_count(tmp_path: Path, option: dict[str, Any], text: str) -> None:
    path = tmp_path / "a.obj"
    path.write_text(OBJ)
    asset = imported(tmp_path, path, ImportOptions(crs="local"))
    assert changes(asset, path, replace(ImportOptions(crs="local"), **option)) == f"of changed options: {text}"


def test_options_of_other_formats_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "a.gml"
    path.write_text(GML)
    asset = imported(tmp_path, path, ImportOptions(crs="local"))
    assert changes(asset, path, ImportOptions(crs="local", up="y", split="group")) is None
    assert changes(asset, path, ImportOptions(crs="local", lod="2")) == "of changed options: lod (none → 2)"


def test_changed_files_and_readers_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.obj"
    path.write_text(OBJ)
    asset = imported(tmp_path, path, ImportOptions(crs="local"))
    monkeypatch.setattr("map3d.formats.FORMATS", [replace(format, version=format.version + 1) for format in FORMATS])
    reason = changes(asset, path, ImportOptions(crs="local"))
    assert reason is not None
    assert reason.startswith("map3d reads its format in a new way")
    path.write_text(OBJ + "v 1 1 1\nf 1 2 4\n")
    assert changes(asset, path, ImportOptions(crs="local")) == "the file changed"


def test_code_lists_count_as_files(tmp_path: Path) -> None:
    path, codes = tmp_path / "a.gml", tmp_path / "codes.xml"
    path.write_text(GML.replace("<bldg:lod1Solid>", '<bldg:usage codeSpace="codes.xml">1</bldg:usage><bldg:lod1Solid>'))
    codes.write_text("<Dictionary/>")
    asset = imported(tmp_path, path, ImportOptions(crs="local"))
    assert changes(asset, path, ImportOptions(crs="local")) is None
    codes.write_text("<Dictionary><dictionaryEntry/></Dictionary>")
    assert changes(asset, path, ImportOptions(crs="local")) == "the file changed"


def test_textures_of_textured_surfaces_count_as_files(tmp_path: Path) -> None:
    path, image = tmp_path / "town.gml", tmp_path / "wall.png"
    path.write_text("<CityModel><tex:textureMap>wall.png</tex:textureMap><tex:textureMap>gone.png</tex:textureMap></CityModel>")
    before = source_digest(find_sources([path])[0])
    image.write_bytes(b"1")
    assert source_digest(find_sources([path])[0]) != before
    found = CITYGML.find_missing(path, None)
    assert (found.names, found.images, found.missing_images) == (["gone.png"], 2, 1)


def test_an_asset_of_an_earlier_map3d_is_imported_again_once(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(OBJ)
    asset = imported(tmp_path, path, ImportOptions())
    earlier = replace(asset, source_digest=source_digest(find_sources([path])[0]), report={"triangles": 1})
    assert changes(earlier, path, ImportOptions()) == "an earlier version of map3d did not record its options"
    assert changes(imported(tmp_path, path, ImportOptions()), path, ImportOptions()) is None


def test_an_unreadable_file_is_an_error_that_names_it(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(OBJ)
    (source,) = find_sources([path])
    path.unlink()
    with pytest.raises(NotFound, match=r"a\.obj: cannot read the file: No such file"):
        import_inputs(source, ImportOptions())


def test_readers_that_make_other_assets_have_another_version(tmp_path: Path) -> None:
    """When this fails, a reader makes another asset of the same file: raise the version in its row of the formats and record the new digests here."""
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "b.gml").write_text(GML)
    write(tmp_path / "c.tif", (np.arange(17 * 17) * 5 % 11).reshape(1, 17, 17).astype(np.float32))
    found = {name: imported(tmp_path, tmp_path / name, ImportOptions(crs="EPSG:25832")).digest for name in ("a.obj", "b.gml", "c.tif")}
    assert ({format.name: format.version for format in FORMATS}, found) == (
        {"citygml": 13, "obj": 4, "raster": 6},
        {"a.obj": "8d0ceef106fedeffefc608f4ab2e7ffa", "b.gml": "ce43c3ba3b9953057ef04c13e472131e", "c.tif": "c5f3a36ca5208765445bbcd024ea08ea"},
    )
