"""Surfaces without a colour of their own: soft tones by default, colours of a style file by surface, class and attribute."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from map3d.catalogue import Workspace
from map3d.errors import BadRequest
from map3d.registry import Registry
from map3d.scenes.build import open_scene
from map3d.scenes.style import check_style, read_style
from tests.cli.towns import Run
from tests.odd_cities.towns import write_citygml

_core = pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

BLUE, GREEN, SAND = (32, 64, 208), (16, 160, 32), (224, 208, 160)
STYLE = {
    "rules": [
        {"surface": "roof", "attributes": {"function": "school"}, "color": "#2040d0"},
        {"surface": "roof", "class": "building", "attributes": {"storeys": 3}, "color": "#10a020"},
        {"surface": "wall", "color": "#e0d0a0"},
    ]
}
SITE = ("-o", "out", "--view", "0-45", "--res", "0.5", "--workers", "1", "--crs", "local")


def write_town(folder: Path) -> None:
    """Writes a town of 16 houses without surface types: house-0-0 is a school, house-1-1 has three storeys."""
    path = write_citygml(folder / "town.gml", None, lambda corners: corners)
    text = path.read_text()
    for name, attribute in (
        ("house-0-0", "<bldg:function>school</bldg:function>"),
        ("house-1-1", "<bldg:storeysAboveGround>3</bldg:storeysAboveGround>"),
    ):
        text = text.replace(f'<bldg:Building gml:id="{name}">', f'<bldg:Building gml:id="{name}">{attribute}')
    path.write_text(text)


def colors(workspace: Workspace) -> dict[str, set[tuple[int, int, int]]]:
    """Returns the colours of each object inside its outline, seen from the south at 45°, without those of pixels at edges."""
    scene = open_scene(workspace, "city")
    half, slope = 120.0, float(np.sqrt(0.5))
    camera = _core.Camera(
        "orthographic", (0, 0, 0), (1, 0, 0), (0, slope, slope), (0, slope, -slope), (-half, half, -half, half), -1000, 1000, 600, 600
    )
    view = scene.render_view(camera, [], samples=4)
    found: dict[str, set[tuple[int, int, int]]] = {}
    with Registry(workspace.registry_path("city")) as registry:
        names = {item.id: item.name for item in registry.objects()}
    for number in np.unique(view["id"]):
        values, counts = np.unique(view["color"][view["id"] == number], axis=0, return_counts=True)
        found[names.get(int(number), "")] = {tuple(int(c) for c in value[:3]) for value, count in zip(values, counts, strict=True) if count > 12}
    return found


def test_a_style_colours_surfaces_by_class_and_attribute_without_importing_again(tmp_path: Path, run: Run) -> None:
    write_town(tmp_path / "city")
    status, out, err = run("site", "city", *SITE)
    assert status == 0, err
    assert "ambient occlusion is rendered, since textures cover less than a tenth of the surfaces" in out
    workspace = Workspace(tmp_path / "workspace")
    plain = colors(workspace)
    roofs = {max(plain[name]) for name in plain if name.startswith("house")}
    assert len(roofs) > 2, "neighbours differ"
    assert not {BLUE, GREEN, SAND} & set().union(*plain.values())
    style = {"rules": [{**rule, "attributes": {"storeysAboveGround": 3}} if "class" in rule else rule for rule in STYLE["rules"]]}
    (tmp_path / "style.json").write_text(json.dumps(style))
    status, out, err = run("site", "city", *SITE, "--style", "style.json")
    assert status == 0, err
    assert "1 unchanged" in out
    styled = colors(workspace)
    assert {BLUE, SAND} <= styled["house-0-0"]
    assert {GREEN, SAND} <= styled["house-1-1"]
    assert SAND in styled["house-2-2"]
    assert not {BLUE, GREEN} & styled["house-2-2"]
    assert run("site", "city", *SITE)[0] == 0
    assert colors(workspace) == plain


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([], 'a style is {"rules": [{"surface": "roof", "color": "#8a5a44"}, …]}'),
        ({"rules": [{}], "more": 1}, "a style is "),
        ({"rules": ["red"]}, "rule 1: expected an object"),
        ({"rules": [{"surface": "roof"}]}, "rule 1: color is null, expected six hexadecimal digits after #"),
        ({"rules": [{"color": "red"}]}, 'rule 1: color is "red"'),
        ({"rules": [{"color": "#fff"}]}, 'rule 1: color is "#fff"'),
        ({"rules": [{"color": "#ffffff"}, {"color": "#ffffff", "surface": "facade"}]}, 'rule 2: surface is "facade", expected one of wall, roof'),
        ({"rules": [{"color": "#ffffff", "class": 7}]}, "rule 1: class is the class of an object"),
        ({"rules": [{"color": "#ffffff", "attributes": {}}]}, "rule 1: attributes are names with values"),
        ({"rules": [{"color": "#ffffff", "attributes": {"a": [1]}}]}, "rule 1: the value of a is [1]"),
        ({"rules": [{"color": "#ffffff", "colour": "#ffffff"}]}, "rule 1: unknown key colour"),
        ({"rules": [{"color": "#ffffff"}] * 1001}, "1,001 rules, expected at most 1,000"),
    ],
)
def test_a_wrong_style_names_the_rule(value: Any, message: str) -> None:
    with pytest.raises(BadRequest) as error:
        check_style(value)
    assert str(error.value).startswith(message)


def test_a_style_file_that_cannot_be_read_is_named(tmp_path: Path, run: Run) -> None:
    (tmp_path / "style.json").write_text('{"rules": [')
    with pytest.raises(BadRequest, match=r"style\.json: not a JSON file in UTF-8"):
        read_style(tmp_path / "style.json")
    status, _, err = run("create-scene", "town", "--style", "absent.json")
    assert (status, "absent.json: No such file or directory" in err) == (2, True), err
