"""The forms of the web interface offer every field of their requests, and what a user sends arrives."""
# ruff: noqa: F811

from html import unescape
from html.parser import HTMLParser

from map3d.lifecycle.create_rendering import create_rendering
from map3d.requests import AddFiles, ChangeRendering, CreateRendering, CreateScene, Publish
from map3d.requests.param import fields_of
from map3d.web.studio.forms import FORMS, more_fields
from tests.cli.towns import house
from tests.web.test_studio import built_town, town  # noqa: F401


class Controls(HTMLParser):
    """The controls of a page: name → its options with the selected one first, or its value, and the limits of a number."""

    def __init__(self, text):
        super().__init__()
        self.found, self.limits, self._open = {}, {}, None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if tag == "select":
            self._open = self.found.setdefault(values["name"], [])
        elif tag == "option" and self._open is not None:
            self._open.insert(0 if "selected" in values else len(self._open), values.get("value"))
        elif tag == "input" and "name" in values:
            switched_off = values.get("type") == "checkbox" and "checked" not in values
            self.found.setdefault(values["name"], []).insert(1 if switched_off else 0, values.get("value", ""))
            self.limits[values["name"]] = values.get("min"), values.get("max")

    def handle_endtag(self, tag):
        self._open = None if tag == "select" else self._open


BY_HAND = {"res_m": "res", "layers": "layer"}
"""Names of fields in the form of a new rendering that differ from those of the REST API."""


def test_forms_have_every_field(town):
    catalogue = town.workspace.open_catalogue()
    request = CreateRendering(scene="town", name="r", levels=1)
    create_rendering(town.workspace, catalogue, request)
    catalogue.close()
    changes = {Publish: "renderings/r", ChangeRendering: "renderings/r"}
    pages = {CreateScene: "scenes/new", AddFiles: "scenes/town", CreateRendering: "scenes/town/renderings/new"} | changes
    assert set(pages) == set(FORMS)
    for request, path in pages.items():
        text = unescape(town.get(f"/studio/{path}").text)
        controls = Controls(text)
        assert {BY_HAND.get(one.name, one.rest) for one in fields_of(request).values() if one.is_on("studio")} <= set(controls.found)
        for one in more_fields(request):
            options = ("no", "yes") if one.kind is bool else tuple(map(str, one.param.choices))
            default = "yes" if one.value is True else "no" if one.value is False else "" if one.value is None or one.param.default else str(one.value)
            assert one.param.label in text
            assert controls.found[one.rest][0] == default
            assert not options or sorted(controls.found[one.rest]) == sorted(options)
            if one.kind in (int, float) and not options and not one.param.is_size:
                limits = (one.param.minimum, one.param.maximum)
                assert controls.limits[one.rest] == tuple(None if limit is None else str(limit) for limit in limits)


def test_more_options_reach_the_operation_and_the_rendering(town):
    sent = {"max_error_m": "0.5", "strict": "yes", "parse_memory_bytes": "2G", "name": "", "crs": "local", "interiors": ""}
    town.post("/studio/scenes/town/import", file=town.upload("c.obj", house(80, 0, 7).encode()), **sent)
    options = {"max_error_m": 0.5, "strict": True, "parse_memory_bytes": 2 << 30, "crs": "local"}
    assert town.last("import").arguments["options"] == options
    more = {"color": "jpeg", "quality": "70", "small": "yes", "levels": "2", "tile_px": "512", "window": "0, 0, 64", "sun": "195,60", "res": ""}
    fields = {"name": "r", "layer": ["color", "picture"], "attribution": "© me", "radius_m": "7.5", **more}
    assert town.post("/studio/scenes/town/renderings/new", **fields).status_code == 303
    catalogue = town.workspace.open_catalogue()
    made = catalogue.rendering("r")
    catalogue.close()
    color, picture = made.layers
    assert (color.format, color.quality, color.small, picture.radius_m, picture.suns[0].azimuth_deg) == ("jpeg", 70, True, 7.5, 195)
    assert (made.zmax, made.tile_px, made.attribution, made.window.size_m) == (1, 512, "© me", 64)
    scene = {"name": "plain", "title": "Plain", "merge_faces": "no", "drop_untextured": "yes", "crs": "local"}
    assert town.post("/studio/scenes/new", **scene).status_code == 303
    catalogue = town.workspace.open_catalogue()
    steps = catalogue.scene("plain").options
    catalogue.close()
    assert (steps["merge_faces"], steps["drop_untextured"], steps["merge_vertices"]) == (False, True, True)


def test_a_field_that_cannot_be_read_shows_the_form_again(town):
    sent = {"name": "kept", "layer": ["color", "ao"], "radius_m": "wide", "quality": "70", "pitch": "60"}
    answer = town.post("/studio/scenes/town/renderings/new", **sent)
    text = unescape(answer.text)
    assert answer.status_code == 400
    assert "radius_m is 'wide', expected a number" in text
    found = Controls(text).found
    assert (found["name"][0], found["radius_m"][0], found["quality"][0], float(found["pitch"][0])) == ("kept", "wide", "70", 60)
    catalogue = town.workspace.open_catalogue()
    create_rendering(town.workspace, catalogue, CreateRendering(scene="town", name="r", levels=1))
    catalogue.close()
    published = town.post("/studio/renderings/r/publish", folder="Not a name")
    assert published.status_code == 400
    assert "Not a name" in unescape(published.text)
