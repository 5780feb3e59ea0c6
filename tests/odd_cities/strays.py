"""Small towns with something far away: a polygon, a building, a file. Each function writes one odd town into a folder."""

from pathlib import Path

import numpy as np

from tests.cli.towns import house
from tests.odd_cities.towns import MUNICH, at, write_citygml

UTM32, UTM33 = "EPSG:25832", "EPSG:25833"


def polygon_at_0_0_0(folder: Path) -> Path:
    """Writes a town of 16 houses; one polygon of `house-1-2` lies at 0, 0, 0."""
    path = write_citygml(folder / "town.gml", UTM32, at(*MUNICH, UTM32))
    return _replace_positions(path, "house-1-2-5-r", np.array([(0, 0, 0), (8, 0, 0), (8, 0, 6), (0, 0, 0)]))


def corner_at_0_0_0(folder: Path) -> Path:
    """Writes a town of 16 houses; a polygon of `house-1-2` reaches from the town to 0, 0, 0."""
    path = write_citygml(folder / "town.gml", UTM32, at(*MUNICH, UTM32))
    first = _positions(path, "house-1-2-5-r")
    return _replace_positions(path, "house-1-2-5-r", np.vstack([first[:2], np.zeros((1, 3)), first[:1]]))


def building_of_another_zone(folder: Path) -> Path:
    """Writes a town of zone 32, and one of its buildings in a file with numbers of zone 33 and the label of zone 32."""
    write_citygml(folder / "town.gml", UTM32, at(*MUNICH, UTM32))
    write_citygml(folder / "other.gml", UTM32, at(*MUNICH, UTM33), side=1, prefix="other-")
    return folder


def three_files_100_km_apart(folder: Path) -> Path:
    """Writes towns of 25, 16 and 9 houses in local metres."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, side in enumerate((5, 4, 3)):
        write_obj_town(folder / f"town-{number}.obj", side, (100_000.0 * number, 0.0))
    return folder


def two_triangles_5000_km_apart(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for number in (0, 1):
        x = 5e6 * number
        (folder / f"triangle-{number}.obj").write_text(f"v {x} 0 0\nv {x + 10} 0 0\nv {x} 10 5\nf 1 2 3\n")
    return folder


def scattered_files(folder: Path) -> Path:
    """Writes 60 files with a house each, hundreds of kilometres from each other, and a triangle larger than the Earth."""
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(60):
        (folder / f"house-{k}.obj").write_text(house(float(k * k % 61) * 90_000.0, float(k * 37 % 53) * 110_000.0, 9.0))
    (folder / "huge.obj").write_text("v 0 0 0\nv 9e7 0 0\nv 0 9e7 0\nf 1 2 3\n")
    return folder


def nodata_heights(folder: Path) -> Path:
    """Writes a town of 16 houses and two polygons at a height of -9999."""
    folder.mkdir(parents=True, exist_ok=True)
    path = write_obj_town(folder / "town.obj", 4, (5000.0, 5000.0))
    path.write_text(path.read_text() + "v 5010 5010 -9999\nv 5020 5010 -9999\nv 5020 5020 -9999\nv 5010 5020 -9999\nf -4 -3 -2\nf -4 -2 -1\n")
    return folder


def write_obj_town(path: Path, side: int, corner: tuple[float, float]) -> Path:
    """Writes side × side houses, 40 m apart, as groups of one OBJ file."""
    parts = []
    for i in range(side):
        for j in range(side):
            text = house(corner[0] + 40.0 * i, corner[1] + 40.0 * j, 6.0 + (3 * i + 5 * j) % 7)
            parts.append("\n".join([f"g house-{i}-{j}", *map(_with_relative_numbers, text.splitlines())]))
    path.write_text("\n".join(parts) + "\n")
    return path


def _with_relative_numbers(line: str) -> str:
    """Counts the vertices of a face back from the last of eight."""
    return " ".join(["f", *(str(int(word) - 9) for word in line.split()[1:])]) if line.startswith("f") else line


def move_polygon(path: Path, points: np.ndarray) -> Path:
    """Replaces a wall of `house-1-2`."""
    return _replace_positions(path, "house-1-2-5-r", np.vstack([points, points[:1]]), "%.9f")


def move_corner(path: Path, corner: np.ndarray, *, by: bool = False) -> Path:
    """Moves a corner of a wall of `house-1-2` to another place, or `by` so much."""
    points = _positions(path, "house-1-2-5-r")
    points[2] = points[2] + corner if by else corner
    return _replace_positions(path, "house-1-2-5-r", points, "%.9f")


def _ring(path: Path, ring: str) -> tuple[str, int, int]:
    """Returns the text of a file, and where the positions of a ring begin and end."""
    text = path.read_text()
    start = text.index(">", text.index("<gml:posList", text.index(f'gml:id="{ring}"'))) + 1
    return text, start, text.index("<", start)


def _positions(path: Path, ring: str) -> np.ndarray:
    text, start, end = _ring(path, ring)
    return np.array([float(word) for word in text[start:end].split()]).reshape(-1, 3)


def _replace_positions(path: Path, ring: str, points: np.ndarray, format: str = "%.3f") -> Path:
    text, start, end = _ring(path, ring)
    path.write_text(text[:start] + " ".join(format % value for value in points.ravel()) + text[end:])
    return path
