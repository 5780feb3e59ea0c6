"""Sun and ambient occlusion layers on the command line: the rendering stores the requested layers. Nothing is rendered here."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.cli.towns import Run, copy_original, make_original, write_town

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

TIME = ("--time", "2026-06-21T15:00+02:00")
PLACE = ("--place", "48.76,11.42")
NEW = ("create-rendering", "town", "new", "--res", "0.2", "--view", "0/45")


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("original")
    return make_original(
        folder,
        ("create-scene", "town"),
        ("add-files", "town", str(write_town(folder / "files"))),
        ("create-rendering", "town", "view", "--res", "0.2", "--view", "0/45"),
    )


@pytest.fixture
def town(run: Run, original: Path, tmp_path: Path) -> Run:
    """A rendering `view` of the scene `town`, in local metres."""
    copy_original(original, tmp_path)
    return run


def passes(run: Run, rendering: str) -> list[list[dict[str, Any]]]:
    status, out, err = run("show", "rendering", rendering, "--json")
    assert status == 0, err
    found: list[list[dict[str, Any]]] = json.loads(out)["rendering"]["passes"]
    return found


def test_layers_are_stored_with_suns_and_radius(town: Run) -> None:
    more = ("--layers", "color,noon=sun,sun16,ao,picture", *TIME, *PLACE, "--date", "2026-06-21", "--ao-radius", "12.5", "--color", "jpeg")
    assert town(*NEW, *more)[0] == 0
    ((color, noon, day, ao, picture),) = passes(town, "new")
    assert [layer["kind"] for layer in (color, noon, day, ao, picture)] == ["color", "sun", "sun16", "ao", "picture"]
    assert (noon["name"], [sun["time"] for sun in noon["suns"]]) == ("noon", ["2026-06-21T13:00:00Z"])
    assert noon["suns"] == picture["suns"]
    assert [sun["time"] for sun in day["suns"]] == [f"2026-06-21T{hour:02}:00:00Z" for hour in range(4, 20)]
    assert (color["format"], picture["format"], noon["format"]) == ("jpeg", "jpeg", "png")
    assert (color["radius_m"], ao["radius_m"], picture["radius_m"]) == (None, 12.5, 12.5)
    # Nearly two hours past the sun's own noon: in the south-west.
    assert 200 < noon["suns"][0]["azimuth_deg"] < 250
    assert noon["suns"][0]["direction"][1] < 0 < noon["suns"][0]["direction"][2]


def test_second_layer_of_the_same_kind_has_another_name_and_pass(town: Run) -> None:
    assert town("add-layers", "view", "--layers", "sun,depth2", *TIME, *PLACE)[0] == 0
    assert town("add-layers", "view", "--layers", "sun", "--sun", "280,12")[0] == 2, "the name is taken"
    status, out, err = town("add-layers", "view", "--layers", "evening=sun", "--sun", "280,12")
    assert (status, out) == (0, "rendering view: 5 layers; next: map3d render view\n"), err
    assert [[layer["name"] for layer in layers] for layers in passes(town, "view")] == [
        ["color", "data"],
        ["sun", "depth2"],
        ["evening"],
    ]
    (evening,) = passes(town, "view")[2][0]["suns"]
    assert (evening["time"], evening["azimuth_deg"], evening["elevation_deg"]) == (None, 280.0, 12.0)
    shown = town("show", "rendering", "view")[1]
    assert "added layers: sun (png), depth2 (png)\nadded layers: evening (png)\n" in shown


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--layers", "sun"), "--time 2026"),
        (("--layers", "sun", "--time", "2026-06-21T15:00", *PLACE), "missing time zone"),
        (("--layers", "sun", "--time", "yesterday"), "not a date and time"),
        (("--layers", "sun", *TIME), "is in local metres"),
        (("--layers", "sun", "--time", "2026-12-21T02:00+01:00", *PLACE), "below the horizon"),
        (("--layers", "sun", *TIME, "--place", "48.76"), "not LATITUDE,LONGITUDE"),
        (("--layers", "sun", "--sun", "high"), "not AZIMUTH,ELEVATION"),
        (("--layers", "sun16", *PLACE), "--date 2026"),
        (("--layers", "sun16", *PLACE, "--date", "21.6.2026"), "not a date"),
        (("--layers", "ao", "--ao-radius", "300"), "0.5"),
        (("--layers", "depth2", *TIME), "add such a layer to --layers"),
        (("--layers", "moonlight"), "sun, sun16, ao, depth2, picture"),
        (("--layers", "a=sun,b=sun", *TIME, *PLACE), "each name and kind only once"),
        (("--layers", "A=ao",), "layer name 'A'"),
        ((), "--layers"),
    ],
)  # fmt: skip
def test_invalid_layers_are_refused_and_change_nothing(town: Run, options: tuple[str, ...], says: str) -> None:
    before = passes(town, "view")
    for command in (("add-layers", "view"), *((NEW,) if options else ())):
        status, out, err = town(*command, *options)
        assert (status, out) == (2, "")
        assert says in err
    assert passes(town, "view") == before
    assert town("show", "rendering", "new")[0] == 2
