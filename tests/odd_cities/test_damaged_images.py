"""Cut and damaged images of every format are named by their own paths, and their surfaces have a plain colour."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from map3d.catalogue import SceneRecord, Workspace
from map3d.coherence.import_files import import_files
from map3d.ingest.import_options import ImportOptions
from map3d.scenes.build import build
from map3d.scenes.build_process import LEAST_BYTES
from map3d.scenes.file_contents import file_contents
from map3d.scenes.inspection import inspect_files
from tests.findings import warned

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

FORMATS = {
    "baseline.jpg": ("JPEG", {"quality": 90}),
    "progressive.jpg": ("JPEG", {"quality": 90, "progressive": True}),
    "a.png": ("PNG", {}),
    "a.gif": ("GIF", {}),
    "a.bmp": ("BMP", {}),
    "plain.tif": ("TIFF", {}),
    "packed.tif": ("TIFF", {"compression": "tiff_lzw"}),
    "a.webp": ("WEBP", {"quality": 80}),
    "lossless.webp": ("WEBP", {"lossless": True}),
    "plain.tga": ("TGA", {}),
    "packed.tga": ("TGA", {"compression": "tga_rle"}),
}


def encoded(name: str) -> bytes:
    pixels = np.random.default_rng(7).integers(0, 255, (12, 10, 3)).repeat(8, axis=0).repeat(8, axis=1).astype(np.uint8)
    format, options = FORMATS[name]
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, format, **options)
    return out.getvalue()


def write_models(folder: Path, images: dict[str, bytes]) -> Path:
    """Writes an OBJ file with a square for each image."""
    (folder / "tex").mkdir(parents=True)
    lines, library = ["mtllib a.mtl", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"], []
    for k, (name, data) in enumerate(images.items()):
        (folder / "tex" / name).write_bytes(data)
        library += [f"newmtl m{k}", f"map_Kd tex/{name}"]
        lines += [f"usemtl m{k}", *(f"v {10 * k + x} {y} 0" for x, y in ((0, 0), (8, 0), (8, 8), (0, 8)))]
        lines += [f"f {' '.join(f'{4 * k + corner}/{corner}' for corner in (1, 2, 3, 4))}"]
    (folder / "a.mtl").write_text("\n".join(library) + "\n")
    (folder / "a.obj").write_text("\n".join(lines) + "\n")
    return folder


def damaged(findings: list[dict[str, object]]) -> list[tuple[object, object]]:
    """Returns counts and examples. The header of a packed TIFF is at its end."""
    return [(item["count"], item["example"]) for item in findings if item["code"] in ("image-damaged", "image-header-invalid")]


def imported(tmp_path: Path, folder: Path) -> tuple[Workspace, list[dict[str, object]], int]:
    """Imports a folder; returns the findings and the number of images in the asset."""
    workspace = Workspace(tmp_path / "workspace").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    (done,) = import_files(workspace, catalogue, "town", [folder], ImportOptions(crs="local")).imported
    catalogue.close()
    return workspace, warned(done.report), len(list((workspace.asset_folder("town", done.asset) / "textures").iterdir()))


def test_whole_images_have_no_fault(tmp_path: Path) -> None:
    _, findings, images = imported(tmp_path, write_models(tmp_path / "city", {name: encoded(name) for name in FORMATS}))
    assert (findings, images) == ([], len(FORMATS))


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("share", [0.4, 0.95])
def test_a_cut_image_is_named(tmp_path: Path, name: str, share: float) -> None:
    data = encoded(name)
    _, findings, images = imported(tmp_path, write_models(tmp_path / "city", {name: data[: int(len(data) * share)], "good.png": encoded("a.png")}))
    assert (damaged(findings), images) == ([(1, f"tex/{name}")], 1)


def test_all_damaged_images_are_named(tmp_path: Path) -> None:
    cut = {f"{k}.png": encoded("a.png")[: -20 - k] for k in range(7)}
    _, findings, images = imported(tmp_path, write_models(tmp_path / "city", cut))
    assert (damaged(findings), images) == ([(7, "tex/0.png, tex/1.png, tex/2.png, tex/3.png, tex/4.png")], 0)


def test_changed_bytes_of_a_png_are_damage(tmp_path: Path) -> None:
    data = bytearray(encoded("a.png"))
    data[len(data) // 2] ^= 0xFF
    assert damaged(imported(tmp_path, write_models(tmp_path / "city", {"a.png": bytes(data)}))[1]) == [(1, "tex/a.png")]


def test_foreign_bytes_in_a_jpeg_are_damage(tmp_path: Path) -> None:
    data = bytearray(encoded("baseline.jpg"))
    middle = len(data) // 2
    data[middle : middle + 1000] = np.random.default_rng(3).bytes(1000)
    assert damaged(imported(tmp_path, write_models(tmp_path / "city", {"a.jpg": bytes(data)}))[1]) == [(1, "tex/a.jpg")]


def broken_inside(name: str = "a.webp") -> bytes:
    """Returns an image whose structure is whole: only decoding shows its damage."""
    data = bytearray(encoded(name))
    data[30:90] = bytes(60)
    return bytes(data)


def test_damage_that_only_decoding_shows_is_in_the_reports_of_a_build_and_of_an_inspection(tmp_path: Path) -> None:
    folder = write_models(tmp_path / "city", {"lossless.webp": broken_inside("lossless.webp"), "good.png": encoded("a.png")})
    workspace, findings, images = imported(tmp_path, folder)
    assert (damaged(findings), images) == ([], 2)
    catalogue = workspace.open_catalogue()
    for _ in range(2):
        build(workspace, catalogue, "town", threads=1, max_memory_bytes=LEAST_BYTES)
        (file,) = file_contents(workspace, catalogue, "town")
        found = [(item.count, item.example) for item in file.findings if item.reason.code == "image-damaged"]
        assert found == [(1, "tex/lossless.webp")]
    catalogue.close()
    (file,) = inspect_files([folder], ImportOptions(crs="local")).files
    assert [item.example for item in file.findings if item.reason.code == "image-damaged"] == ["tex/lossless.webp"]
