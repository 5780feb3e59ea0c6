"""Laws of the CityGML of towns of both styles."""

import itertools
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.town.documents import APP, BLDG, CORE, GML, XLINK, normal, numbers, parse_files, rings_by_polygon, solids, textures


def test_rings_are_closed_and_have_area(either: Path) -> None:
    for root in parse_files(either):
        for name, rings in rings_by_polygon(root).items():
            for ring in rings.values():
                assert len(ring) >= 4, name
                assert np.array_equal(ring[0], ring[-1]), name
                assert np.linalg.norm(normal(ring)) > 1e-4, name


def test_polygons_are_flat_within_a_millimetre(either: Path) -> None:
    for root in parse_files(either, "buildings_*.gml"):
        for name, rings in rings_by_polygon(root).items():
            outer = next(iter(rings.values()))
            unit = normal(outer) / np.linalg.norm(normal(outer))
            for ring in rings.values():
                assert np.abs((ring - outer.mean(axis=0)) @ unit).max() < 1e-3, name


def test_solids_share_each_edge_twice_in_opposite_directions(either: Path) -> None:
    count = 0
    for root in parse_files(either, "buildings_*.gml"):
        for name, shell in solids(root):
            edges: Counter[tuple[tuple[float, ...], tuple[float, ...]]] = Counter()
            for rings in shell:
                for ring in rings:
                    points = [tuple(p) for p in ring.tolist()]
                    edges.update(itertools.pairwise(points))
            assert set(edges.values()) == {1}, name
            assert all((b, a) in edges for a, b in edges), name
            count += 1
    assert count > 5


def test_solids_face_outward(either: Path) -> None:
    for root in parse_files(either, "buildings_*.gml"):
        for name, shell in solids(root):
            middle = np.concatenate([r for rings in shell for r in rings]).mean(axis=0)
            signed_volume = sum(float(normal(r) @ (r[0] - middle)) for rings in shell for r in rings) / 6
            assert signed_volume > 0.5, name


def test_interior_rings_have_the_opposite_orientation(either: Path) -> None:
    holes = 0
    for root in parse_files(either, "buildings_*.gml"):
        for rings in rings_by_polygon(root).values():
            outer, *inner = rings.values()
            for hole in inner:
                assert normal(hole) @ normal(outer) < 0
                holes += 1
    assert holes > 0


def test_ids_are_unique_and_links_resolve(either: Path) -> None:
    ids: Counter[str] = Counter()
    for root in parse_files(either):
        own = [e.attrib[GML + "id"] for e in root.iter() if GML + "id" in e.attrib]
        ids.update(own)
        known = set(own)
        links = [e.attrib[XLINK][1:] for e in root.iter() if XLINK in e.attrib]
        links += [e.attrib["uri"][1:] for e in root.iter(APP + "target") if "uri" in e.attrib]
        links += [e.text[1:] for e in root.iter(APP + "target") if e.text and e.text.startswith("#")]
        assert links
        assert set(links) <= known
    assert set(ids.values()) == {1}


def test_every_texture_exists(either: Path) -> None:
    for root in parse_files(either):
        found = list(textures(root))
        assert found
        for uri, _, _ in found:
            assert (either / "citygml" / uri).is_file(), uri


def test_every_ring_of_a_target_has_texture_coordinates(either: Path) -> None:
    for root in parse_files(either):
        lengths = {ring: len(points) for rings in rings_by_polygon(root).values() for ring, points in rings.items()}
        for _, _, coordinates in textures(root):
            for ring, uv in coordinates.items():
                assert len(uv) == lengths[ring], ring
                assert np.array_equal(uv[0], uv[-1]), ring


def test_every_polygon_has_a_material(either: Path) -> None:
    for root in parse_files(either):
        targets = {e.attrib["uri"][1:] for e in root.iter(APP + "target") if "uri" in e.attrib}
        targets |= {e.text[1:] for e in root.iter(APP + "target") if e.text and e.text.startswith("#")}
        assert set(rings_by_polygon(root)) <= targets


def test_atlas_coordinates_are_in_the_used_part(either: Path) -> None:
    """No texel at a texture coordinate is magenta, and each town has unused atlas area."""
    unused = []
    for root in parse_files(either, "buildings_*.gml"):
        for uri, mode, coordinates in textures(root):
            if mode != "none":
                continue
            picture = np.asarray(Image.open(either / "citygml" / uri).convert("RGB")).astype(int)
            magenta = np.abs(picture - [255, 0, 255]).sum(axis=2) < 90
            unused.append(magenta.mean())
            side = len(picture)
            for ring, uv in coordinates.items():
                assert uv.min() >= 0, ring
                assert uv.max() <= 1, ring
                column = np.clip((uv[:, 0] * side).astype(int), 0, side - 1)
                row = np.clip(((1 - uv[:, 1]) * side).astype(int), 0, side - 1)
                assert not magenta[row, column].any(), (uri, ring)
    assert np.mean(unused) > 0.03


def test_some_repeating_textures_have_coordinates_beyond_1(either: Path) -> None:
    largest = [uv.max() for root in parse_files(either, "buildings_*.gml") for _, mode, c in textures(root) if mode == "wrap" for uv in c.values()]
    assert max(largest) > 1.5


def test_buildings_are_in_the_envelope_of_their_file(either: Path) -> None:
    for root in parse_files(either, "buildings_*.gml"):
        low, high = (numbers(root.findtext(f".//{GML}{c}Corner"), 3)[0] for c in ("lower", "upper"))
        points = np.concatenate([r for rings in rings_by_polygon(root).values() for r in rings.values()])
        assert (points >= low).all()
        assert (points <= high).all()


def test_buildings_have_attributes(either: Path) -> None:
    for root in parse_files(either, "buildings_*.gml"):
        for building in root.iter(BLDG + "Building"):
            assert building.findtext(GML + "name")
            function = building.findtext(BLDG + "function")
            assert function is None or re.fullmatch(r"31001_[0-9]{4}", function), "a code of the AdV"
            assert 0 < int(building.findtext(BLDG + "yearOfConstruction") or 0) < 2100


def test_trees_share_one_prototype_per_species(either: Path) -> None:
    for root in parse_files(either, "trees_*.gml"):
        own = root.findall(f".//{CORE}relativeGMLGeometry/{GML}MultiSurface")
        every = root.findall(f".//{CORE}relativeGMLGeometry")
        assert 1 <= len(own) < len(every)
        for matrix in root.iter(CORE + "transformationMatrix"):
            m = numbers(matrix.text, 4)
            assert np.linalg.det(m[:3, :3]) > 1
            assert np.array_equal(m[3], [0, 0, 0, 1])


def test_leaf_textures_have_transparent_pixels(either: Path) -> None:
    for path in sorted((either / "citygml" / "textures").glob("*.png")):
        alpha = np.asarray(Image.open(path))[..., 3]
        assert set(np.unique(alpha)) == {0, 255}
        assert 0.3 < (alpha == 255).mean() < 0.9, path


@pytest.mark.parametrize("kind", ["Window", "Door"])
def test_some_buildings_have_modelled_openings(town: Path, kind: str) -> None:
    assert sum(len(list(root.iter(BLDG + kind))) for root in parse_files(town, "buildings_*.gml")) > 0
