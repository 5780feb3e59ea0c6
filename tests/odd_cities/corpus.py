"""A folder with every oddity at once: files that are read right and said, files that are refused with a reason, and what belongs to none."""

import gzip
import math
import random
from pathlib import Path

from PIL import Image

from tests.cli.towns import house
from tests.ingest.terrain.rasters import colours, hills
from tests.odd_cities import strays
from tests.odd_cities.appearances import add_themes, add_transparency
from tests.odd_cities.test_tiled_rasters import write_tiles
from tests.odd_cities.towns import HEAD, MUNICH, at, write_citygml

UTM = "EPSG:25832"
EAST, NORTH = 691_600.0, 5_334_700.0
"""A corner in the middle of Munich."""

PACKED_MIB = 256
"""Size of the content of packed.gml.gz."""
SPARSE_BYTES = 50 << 30
SPIRAL_CORNERS = 40_000


def write_corpus(folder: Path) -> Path:
    """Writes the files of a city around Munich, one or two for each oddity."""
    strays.polygon_at_0_0_0(folder / "stray")
    write_citygml(folder / "other-zone.gml", UTM, at(*MUNICH, "EPSG:25833"), side=1, prefix="zone-")
    write_citygml(folder / "swapped.gml", "EPSG:4326", at(MUNICH[0] + 0.004, MUNICH[1], "EPSG:4326"), side=3, prefix="swapped-")
    write_citygml(folder / "gauss-krueger.gml", "EPSG:31468", at(*MUNICH, "EPSG:4326"), side=1, prefix="gk-")
    write_citygml(folder / "no-label.gml", None, at(*MUNICH, UTM), side=1, prefix="none-")
    _cut(write_citygml(folder / "cut.gml", UTM, at(MUNICH[0], MUNICH[1] + 0.004, UTM), prefix="cut-"))
    _textures_beside_and_above(folder / "models", folder / "textures")
    add_transparency(
        write_citygml(folder / "opacity.gml", UTM, at(MUNICH[0] - 0.004, MUNICH[1], UTM), side=2, prefix="faint-"),
        "1.0",
        "0.5",
        side=2,
        prefix="faint-",
    )
    add_themes(
        write_citygml(folder / "photos" / "themes.gml", UTM, at(MUNICH[0] - 0.004, MUNICH[1] - 0.002, UTM), side=2, prefix="theme-"),
        side=2,
        prefix="theme-",
    )
    _pack(write_citygml(folder / "packed.gml", UTM, at(MUNICH[0], MUNICH[1] - 0.003, UTM), side=2, prefix="packed-"))
    (folder / "spiral.obj").write_text(_spiral(SPIRAL_CORNERS // 2))
    (folder / "latin-1.gml").write_bytes(_latin_1())
    (folder / "two-lods.gml").write_text(_two_lods())
    write_tiles(folder / "dem", "dem", hills(40, 40), 20)
    (folder / "dem" / "dem-20-20.tif").unlink()
    write_tiles(folder / "dem", "photo", colours(80, 80), 40, 0.5)
    (folder / "town.json").write_text('{"type": "CityJSON", "version": "2.0"}')
    (folder / "points.las").write_bytes(b"LASF" + bytes(100))
    with (folder / "sparse.gml").open("wb") as sparse:
        sparse.truncate(SPARSE_BYTES)
    return folder


def _cut(path: Path) -> None:
    text = path.read_bytes()
    path.write_bytes(text[: len(text) * 3 // 4])


def _pack(path: Path) -> None:
    """Replaces a document by its packed twin, with long comments before its end."""
    before, end, after = path.read_bytes().rpartition(b"</core:CityModel>")
    random_text = random.Random(1)
    with gzip.GzipFile(path.with_name(f"{path.name}.gz"), "wb", compresslevel=1, mtime=0) as file:
        file.write(before)
        for _ in range(PACKED_MIB):
            file.write(b"<!--" + random_text.randbytes(512).hex().encode() * 1024 + b"-->\n")
        file.write(end + after)
    path.unlink()


def _textures_beside_and_above(models: Path, textures: Path) -> None:
    models.mkdir()
    textures.mkdir()
    Image.new("RGB", (8, 8), (200, 30, 30)).save(textures / "wall.png")
    (models / "shop.mtl").write_text("newmtl wall\nmap_Kd ../textures/wall.png\nnewmtl roof\nmap_Kd ../textures/lost.png\n")
    lines = house(EAST, NORTH, 9.0).splitlines()
    faces = [" ".join(["f", *(f"{word}/{k}" for k, word in enumerate(line.split()[1:], 1))]) for line in lines[8:]]
    (models / "shop.obj").write_text(
        "\n".join(["mtllib shop.mtl", *lines[:8], "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "usemtl wall", *faces[:3], "usemtl roof", *faces[3:]])
        + "\n"
    )


def _spiral(count: int) -> str:
    """Returns one polygon: a band wound up ten times."""
    turns = [2.0 * math.pi * (1.0 + 10.0 * k / count) for k in range(count)]
    out = [(a * 0.5 * math.cos(a), a * 0.5 * math.sin(a)) for a in turns]
    back = [((a + 1.0) * 0.5 * math.cos(a), (a + 1.0) * 0.5 * math.sin(a)) for a in reversed(turns)]
    vertices = "".join(f"v {EAST + 200 + x:.4f} {NORTH + y:.4f} 5\n" for x, y in [*out, *back])
    return vertices + "f " + " ".join(str(k + 1) for k in range(2 * count)) + "\n"


Corner = tuple[float, float, float]


def _polygon(corners: list[Corner], name: str = "") -> str:
    """Takes metres from the corner in Munich."""
    numbers = " ".join(f"{EAST + x} {NORTH + 100 + y} {500 + z}" for x, y, z in [*corners, corners[0]])
    ring = f'<gml:LinearRing><gml:posList srsDimension="3">{numbers}</gml:posList></gml:LinearRing>'
    label = f' gml:id="{name}"' if name else ""
    return f"<gml:Polygon{label}><gml:exterior>{ring}</gml:exterior></gml:Polygon>"


def _multi_surface(lod: int, polygon: str) -> str:
    surface = f'<gml:MultiSurface srsName="{UTM}" srsDimension="3"><gml:surfaceMember>{polygon}</gml:surfaceMember></gml:MultiSurface>'
    return f"<bldg:lod{lod}MultiSurface>{surface}</bldg:lod{lod}MultiSurface>"


def _solid(lod: int, members: list[str]) -> str:
    """`members`: polygons, or names of polygons elsewhere in the document."""
    surfaces = "".join(
        f"<gml:surfaceMember>{member}</gml:surfaceMember>" if member.startswith("<") else f'<gml:surfaceMember xlink:href="#{member}"/>'
        for member in members
    )
    shell = f"<gml:exterior><gml:CompositeSurface>{surfaces}</gml:CompositeSurface></gml:exterior>"
    return f'<bldg:lod{lod}Solid><gml:Solid srsName="{UTM}" srsDimension="3">{shell}</gml:Solid></bldg:lod{lod}Solid>'


def _square(height: float, x: float) -> str:
    return _polygon([(x, 0, height), (x + 10, 0, height), (x + 10, 10, height), (x, 10, height)])


def _box(height: float, x: float) -> list[list[Corner]]:
    """Returns the ground, the roof and four walls."""
    low, high = ([(x + a, b, z) for a, b in ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))] for z in (0.0, height))
    return [low[::-1], high, *([low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]] for k in range(4))]


def _building(name: str, content: str) -> str:
    return f'<core:cityObjectMember><bldg:Building gml:id="{name}">{content}</bldg:Building></core:cityObjectMember>\n'


def _two_lods() -> str:
    """Returns two houses of two levels of detail: one with an attribute of an unknown extension, one whose finer solid is made of its walls."""
    lods = "".join(_multi_surface(lod, _square(3.0 * lod, 0.0)) for lod in (1, 2))
    extension = '<uro:floors xmlns:uro="https://www.geospatial.jp/iur/uro/2.0">4</uro:floors>'
    coarse = _solid(1, [_polygon(face) for face in _box(3.0, 20.0)])
    kinds = ("GroundSurface", "RoofSurface", *["WallSurface"] * 4)
    fine = "".join(
        f"<bldg:boundedBy><bldg:{kind}>{_multi_surface(2, _polygon(face, f'linked-{k}'))}</bldg:{kind}></bldg:boundedBy>"
        for k, (kind, face) in enumerate(zip(kinds, _box(6.0, 20.0), strict=True))
    )
    linked = coarse + _solid(2, [f"linked-{k}" for k in range(6)]) + fine
    return HEAD + _building("two-lods", extension + lods) + _building("linked-lods", linked) + "</core:CityModel>\n"


def _latin_1() -> bytes:
    """Returns a document whose letters are not those of the encoding that it declares."""
    name = "<gml:name>Südhaus</gml:name>"
    return (HEAD + _building("latin-1", name + _multi_surface(1, _square(3.0, 40.0))) + "</core:CityModel>\n").encode("latin-1")
