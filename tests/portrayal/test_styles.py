"""The styles of layers: how colours follow from normals and ids, and what requests and capabilities say of them."""

import io

import numpy as np
import pytest
from lxml import etree
from PIL import Image

from map3d.portrayal.answers import Answer
from map3d.portrayal.service import PortrayalService
from map3d.portrayal.service_exception import ServiceException
from map3d.portrayal.styles import DEFAULT_STYLE, STYLES, find_style, styled_color
from tests.portrayal.conftest import Ask
from tests.portrayal.queries import PERSPECTIVE, get_view

UP, DOWN, NONE = (128, 128, 255), (128, 128, 0), (0, 0, 0)
WALLS = [(255, 128, 128), (0, 128, 128), (128, 255, 128), (128, 0, 128)]


def row(normals: list[tuple[int, int, int]], ids: list[int], alpha: list[int] | None = None) -> dict[str, np.ndarray]:
    """Returns the arrays of a view that is one pixel high, green where something is."""
    opacity = alpha or [255 if id else 0 for id in ids]
    color = [(0, 200 if a else 0, 0, a) for a in opacity]
    return {"color": np.array([color], np.uint8), "normal": np.array([normals], np.uint8), "id": np.array([ids], np.uint32)}


def pixels(answer: Answer) -> np.ndarray:
    assert answer.status == 200, answer.body
    return np.asarray(Image.open(io.BytesIO(answer.body)).convert("RGBA"))


def test_the_default_style_keeps_colours() -> None:
    arrays = row([UP, NONE], [7, 0])
    assert styled_color(DEFAULT_STYLE, arrays) is arrays["color"]


def test_white_is_grey_and_brightest_towards_the_lamp() -> None:
    styled = styled_color("white", row([UP, DOWN, *WALLS], [1, 2, 3, 4, 5, 6]))[0]
    assert (np.ptp(styled[:, :3].astype(int), axis=1) == 0).all()
    up, down, east, west, north, south = styled[:, 0].astype(int)
    assert up > south > west > east > north > down > 60


def test_objects_have_colours_of_their_own_that_only_ids_decide() -> None:
    first = styled_color("objects", row([UP] * 200, list(range(1, 201))))[0]
    second = styled_color("objects", row([UP] * 200, list(range(200, 0, -1))))[0][::-1]
    assert np.array_equal(first, second)
    assert len(np.unique(first[:, :3], axis=0)) > 150
    near = np.abs(first[1:, :3].astype(int) - first[:-1, :3].astype(int)).max(axis=1)
    assert near.min() > 20, "neighbouring ids are easy to tell apart"


@pytest.mark.parametrize("style", [name for name in STYLES if name != DEFAULT_STYLE])
def test_opacity_stays_and_nothing_stays_nothing(style: str) -> None:
    arrays = row([UP, NONE, UP], [1, 0, 2], [255, 0, 99])
    styled = styled_color(style, arrays)[0]
    assert styled[:, 3].tolist() == [255, 0, 99]
    assert styled[1].tolist() == [0, 0, 0, 0]


def test_partly_covered_pixels_take_the_surface_beside_them() -> None:
    styled = styled_color("objects", row([UP, NONE, NONE], [5, 0, 0], [255, 60, 0]))[0]
    assert np.array_equal(styled[0, :3], styled[1, :3])
    assert styled[:, 3].tolist() == [255, 60, 0]


def test_arrays_of_the_view_are_not_changed() -> None:
    arrays = row([UP, NONE], [5, 0], [255, 60])
    copies = {name: array.copy() for name, array in arrays.items()}
    styled_color("white", arrays)
    assert all(np.array_equal(arrays[name], copies[name]) for name in arrays)


def test_an_empty_name_is_the_default_style() -> None:
    assert find_style("") == DEFAULT_STYLE
    with pytest.raises(ServiceException, match=r"expected textured, white, objects"):
        find_style("White")


# -- requests ---------------------------------------------------------------------------------------------------------------------------


def view(more: str, scene: str = "village") -> str:
    return get_view(projection=PERSPECTIVE, more=f"&transparentbackground=true{more}", scene=scene)


def test_requests_choose_styles(ask: Ask) -> None:
    textured, white, objects = (pixels(ask(view(f"&styles={name}")))[50, 10] for name in STYLES)
    assert textured.tolist() == [200, 0, 0, 128]
    assert white[0] == white[1] == white[2] > 60
    assert len({*objects[:3].tolist()}) > 1
    assert textured[3] == white[3] == objects[3]


def test_each_style_is_an_image_of_its_own_in_the_store(ask: Ask, service: PortrayalService) -> None:
    tags = {ask(view(f"&styles={name}")).headers["ETag"] for name in ("", *STYLES)}
    assert (len(tags), service.views.computed) == (3, [3])
    for name in ("", *STYLES):
        ask(view(f"&styles={name}"))
    assert service.views.computed == [3]


def test_other_image_layers_do_not_depend_on_styles(ask: Ask, service: PortrayalService) -> None:
    bodies = {ask(get_view(projection=PERSPECTIVE, layers="OBJECTID", more=f"&styles={name}")).body for name in STYLES}
    assert (len(bodies), service.views.computed) == (1, [1])


def test_layers_have_styles_of_their_own(ask: Ask, service: PortrayalService) -> None:
    """The fake shows object 2, which belongs to `village/low`."""
    for more, scene, white in (
        ("&styles=white,", "village/low,village/high", True),
        ("&styles=,white", "village/low,village/high", False),
        ("&styles=,white", "village/high,village/low", True),
        ("&styles=white,textured", "village,village/low", False),
        ("&styles=textured,white", "village,village/low", True),
    ):
        first = pixels(ask(view(more, scene)))[50, 10].tolist()
        assert (first[0] == first[1] == first[2]) == white, (more, scene)
    assert service.views.computed == [4], "the order of layers is irrelevant"


def test_one_layer_has_one_style(ask: Ask) -> None:
    answer = ask(view("&styles=white,objects", "village/low,village/low"))
    found = etree.fromstring(answer.body)[0]
    assert (answer.status, found.get("exceptionCode"), found.get("locator")) == (400, "InvalidParameterValue", "styles")


def test_without_layers_there_is_no_style_to_choose(ask: Ask) -> None:
    far = "Perspective,48.1,11.5,900,48.2,11.5,0,0,0,1,60,,,"
    statuses = [ask(get_view(projection=far, scene="", crs="EPSG:4326", more=f"&styles={name}")).status for name in ("", "white")]
    assert statuses == [200, 400], "there is one style per layer"


@pytest.mark.parametrize("strict", [False, True])
def test_capabilities_list_the_styles_of_each_layer(ask: Ask, strict: bool) -> None:
    root = etree.fromstring(ask("service=3DPS&request=GetCapabilities", raw=True, strict=strict).body)
    layers = root.xpath("//*[local-name()='Layer']")
    assert len(layers) == 5
    for layer in layers:
        styles = layer.xpath("*[local-name()='AvailableStyle']")
        assert [style.xpath("string(*[local-name()='Identifier'])") for style in styles] == list(STYLES)
        default = [style.xpath("string(*[local-name()='IsDefault'])") for style in styles]
        assert default == (["", "", ""] if strict else ["true", "false", "false"])
