"""Places are named by the town that people know there, with distance and direction; far from all towns by their position alone."""

import pytest

from map3d.geometry.places import find_place
from map3d.geometry.towns import radius_km, towns


@pytest.mark.parametrize(
    ("lon", "lat", "text"),
    [
        (11.575, 48.137, "near Munich, Germany (48.137° N, 11.575° E)"),
        (11.545, 48.118, "near Munich, Germany (48.118° N, 11.545° E)"),  # Sendling, one of its districts
        (11.651, 48.249, "near Garching, Germany (48.249° N, 11.651° E)"),  # a town of its own, 14 km away
        (11.42, 48.766, "near Ingolstadt, Germany (48.766° N, 11.42° E)"),
        (4.48, 51.92, "near Rotterdam, The Netherlands (51.92° N, 4.48° E)"),
        (139.7, 35.66, "near Tokyo, Japan (35.66° N, 139.7° E)"),
        (103.85, 1.29, "near Singapore (1.29° N, 103.85° E)"),
        (-68.3, -54.8, "near Ushuaia, Argentina (54.8° S, 68.3° W)"),
        (7.89, 54.18, "63.2 km north-west of Cuxhaven, Germany (54.18° N, 7.89° E)"),
        (180.0, -16.8, "79 km south-east of Labasa, Fiji (16.8° S, 180° E)"),
        (-180.0, -16.8, "79 km south-east of Labasa, Fiji (16.8° S, 180° W)"),
        (10.0, 23.0, "at 23° N, 10° E, 459 km from Tamanghasset, Algeria"),
        (-40.0, 30.0, "at 30° N, 40° W"),
        (0.0, 90.0, "at 90° N, 0° E"),
    ],
)
def test_place(lon: float, lat: float, text: str) -> None:
    assert str(find_place(lon, lat)) == text


@pytest.mark.parametrize(
    ("east", "north", "direction"),
    [
        (0, 1, "north"), (1, 1, "north-east"), (1, 0, "east"), (1, -1, "south-east"),
        (0, -1, "south"), (-1, -1, "south-west"), (-1, 0, "west"), (-1, 1, "north-west"),
    ],
)  # fmt: skip
def test_directions_are_those_from_the_town(east: int, north: int, direction: str) -> None:
    """Alice Springs has no other town around."""
    assert f" km {direction} of Alice Springs, Australia" in str(find_place(133.883 + 0.3 * east, -23.697 + 0.27 * north))


def test_direction_has_a_word_in_every_language() -> None:
    place = find_place(7.89, 54.18).message
    assert place.text("de") == "63,2\N{NO-BREAK SPACE}km nordwestlich von Cuxhaven, Germany (54,18° N, 7,89° O)"
    assert place.text("fr") == "à 63,2\N{NARROW NO-BREAK SPACE}km au nord-ouest de Cuxhaven, Germany (54,18° N, 7,89° E)"


def test_every_town_is_near_itself_or_a_larger_one() -> None:
    table = towns()
    for town in table.towns[::311]:
        found = find_place(town.lon, town.lat)
        assert found.town == town or (found.town.people >= town.people and found.distance_km < radius_km(found.town.people)), town
