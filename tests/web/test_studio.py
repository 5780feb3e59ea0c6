"""The pages of the web interface, without a browser: what they show, ask for and refuse. The operations they ask for are really done."""

import json
import re
import shutil
from html import unescape
from io import BytesIO
from pathlib import Path
from urllib.parse import urljoin

import pytest
from PIL import Image
from starlette.datastructures import ImmutableMultiDict

from map3d.catalogue import OperationState, Workspace
from map3d.messages import verbatim
from map3d.operations.operation_worker import OperationWorker
from map3d.types import DEFAULT_DATA
from map3d.uploads import Uploads
from map3d.web import create_app
from map3d.web.studio.rendering_form import read_form
from tests.cli.towns import house
from tests.operations.archives import write_zip
from tests.web.accounts import add_token, add_user
from tests.web.conftest import Client

HTML = {"accept": "text/html"}

WITHOUT_CRS = b"""<CityModel xmlns="http://www.opengis.net/citygml/2.0" xmlns:gml="http://www.opengis.net/gml"
  xmlns:bldg="http://www.opengis.net/citygml/building/2.0"><cityObjectMember><bldg:Building gml:id="b"><bldg:lod1MultiSurface><gml:MultiSurface>
  <gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList srsDimension="3">691000 5336000 5 691010 5336000 5 691010 5336010 5
  691000 5336000 5</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface></bldg:lod1MultiSurface>
  </bldg:Building></cityObjectMember></CityModel>"""


def town_files():
    """Two houses; one refers to a texture that is not there."""
    textured = "mtllib town.mtl\nusemtl wall\n" + house(0, 0, 9) + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 4/3\n"
    return {"a.obj": textured.encode(), "town.mtl": b"newmtl wall\nmap_Kd tex/wall.png\n", "b.obj": house(40, 0, 7).encode()}


class Studio:
    """An editor with a token at the web interface of a workspace, and a worker that does operations when the test says so."""

    def __init__(self, client, workspace, token):
        self.client, self.workspace, self.headers = client, workspace, {"authorization": f"Bearer {token}"}

    def get(self, path, **headers):
        return self.client.get(path, headers={**self.headers, **headers})

    def post(self, path, **fields):
        return self.client.request("POST", path, data=fields, headers=self.headers)

    def upload(self, name, data):
        uploads = Uploads(self.workspace.root / "uploads")
        made = uploads.create("anna", name, len(data))
        with uploads.write(made.id, "anna", 0) as writer:
            writer.write(data)
        return made.id

    def work(self):
        """Does all operations that wait."""
        catalogue = self.workspace.open_catalogue()
        worker = OperationWorker(self.workspace, catalogue, poll_s=0.02, heartbeat_s=0.1)
        worker.run(forever=False)
        catalogue.close()

    def last(self, kind):
        catalogue = self.workspace.open_catalogue()
        found = next(one for one in catalogue.operations() if one.kind == kind)
        catalogue.close()
        return found


@pytest.fixture
def studio(tmp_path):
    workspace = Workspace(tmp_path / "ws").create()
    add_user(workspace)
    client = Client(create_app(workspace))
    yield Studio(client, workspace, add_token(workspace))
    client.close()


@pytest.fixture(scope="session")
def built_town(tmp_path_factory):
    """A workspace with a scene `town` that was uploaded as a ZIP archive, imported and built through the web interface."""
    folder = tmp_path_factory.mktemp("studio")
    workspace = Workspace(folder / "ws").create()
    add_user(workspace)
    client = Client(create_app(workspace))
    made = Studio(client, workspace, add_token(workspace))
    assert made.post("/studio/scenes/new", title="Town", name="town", crs="local").headers["location"] == "../../studio/scenes/town"
    packed = write_zip(folder / "town.zip", town_files()).read_bytes()
    assert made.post("/studio/scenes/town/import", file=made.upload("town.zip", packed)).status_code == 303
    made.work()
    client.close()
    return workspace


@pytest.fixture
def town(built_town, tmp_path):
    """A studio at a copy of `built_town`."""
    workspace = Workspace(Path(shutil.copytree(built_town.root, tmp_path / "ws")))
    client = Client(create_app(workspace))
    yield Studio(client, workspace, add_token(workspace))
    client.close()


def test_scene_is_created_with_a_name_from_its_title(studio):
    response = studio.post("/studio/scenes/new", title="Große Straße 5", crs="EPSG:25832", ground_plane="on")
    assert (response.status_code, response.headers["location"]) == (303, "../../studio/scenes/grosse-strasse-5")
    page = studio.get("/studio/scenes/grosse-strasse-5").text
    assert "Große Straße 5" in page
    assert "UTM zone 32N" in page
    assert "Große Straße 5" in studio.get("/studio/").text


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"title": "T", "crs": "EPSG:4326"}, "projected"),
        ({"title": "T", "crs": "nonsense"}, "nonsense"),
        ({"title": "T", "name": "../x"}, "scene name"),
        ({"title": "***"}, "scene name"),
        ({"title": "T", "ground_plane": "x"}, "ground_plane is"),
    ],
)
def test_wrong_scene_is_refused_and_the_form_keeps_its_fields(studio, fields, says):
    response = studio.post("/studio/scenes/new", **fields)
    assert response.status_code == 400
    assert says in unescape(response.text)
    assert f'value="{fields["title"]}"' in response.text
    assert 'role="alert"' in response.text


def test_scene_name_in_use_is_refused(studio):
    studio.post("/studio/scenes/new", title="Town", crs="local")
    assert "exists already" in studio.post("/studio/scenes/new", title="Town", crs="local").text


def test_import_report_names_missing_files_in_words(town):
    page = town.get("/studio/scenes/town").text
    assert "imported 2 files" in page
    assert ">a</a>" in page
    report = unescape(town.get("/studio/scenes/town/files/a").text)
    assert "Textures not found: 1." in report
    assert "tex/wall.png" in report
    assert "No problems" in town.get("/studio/scenes/town/files/b").text
    german = unescape(town.get("/studio/scenes/town/files/a", **{"accept-language": "de"}).text)
    assert "Nicht gefundene Texturen: 1." in german
    assert town.get("/studio/scenes/town/files/zzz").status_code == 404


def test_folder_upload_finds_its_textures(studio):
    wall = BytesIO()
    with Image.new("RGB", (8, 8), (180, 60, 40)) as picture:
        picture.save(wall, "PNG")
    studio.post("/studio/scenes/new", title="Town", crs="local")
    files = {**town_files(), "tex/wall.png": wall.getvalue()}
    ids = [studio.upload(f"model/{name}", data) for name, data in files.items()]
    studio.post("/studio/scenes/town/import", file=ids)
    studio.work()
    assert "No problems" in studio.get("/studio/scenes/town/files/a").text
    assert not [path for path in (studio.workspace.root / "uploads").iterdir() if path.is_dir()], "imported uploads are removed"


def test_import_of_thousands_of_uploads_is_one_form(studio):
    studio.post("/studio/scenes/new", title="Town", crs="local")
    response = studio.post("/studio/scenes/town/import", file=["0" * 16] * 10_000)
    assert response.status_code == 404, "the body is accepted, the uploads are unknown"


def test_import_of_an_incomplete_or_foreign_upload_is_refused(studio):
    studio.post("/studio/scenes/new", title="Town", crs="local")
    uploads = Uploads(studio.workspace.root / "uploads")
    mine, other = uploads.create("anna", "a.obj", 5), uploads.create("ben", "a.obj", 0)
    assert studio.post("/studio/scenes/town/import", file=mine.id).status_code == 400
    assert studio.post("/studio/scenes/town/import", file=other.id).status_code == 404
    assert studio.post("/studio/scenes/town/import").status_code == 400


def test_estimate_says_tiles_bytes_and_time(town):
    found = town.get("/studio/scenes/town/estimate.json?directions=4&pitch=45&res=0.5&layer=color&layer=id").json()
    tiles, images = (int(number.replace(",", "")) for number in re.findall(r"[\d,]+", found["tiles"]))
    assert images == 2 * tiles > 0
    assert re.fullmatch(r"[\d.]+ (kB|MB)", found["size"])
    assert "about" in found["time"]
    refused = town.get("/studio/scenes/town/estimate.json?res=-1")
    assert (refused.status_code, "res is '-1'" in refused.json()["problem"]) == (400, True)
    without_script = town.get("/studio/scenes/town/renderings/new?res=0.5&estimate=1").text
    assert found["size"].split()[1] in without_script


def test_the_form_stores_data_tiles_in_place_of_png_layers(town):
    page = town.get("/studio/scenes/town/renderings/new").text
    assert f'name="data" value="{DEFAULT_DATA}" checked' in page
    sizes = {}
    for data in ("png", "tile"):
        query = f"directions=1&pitch=45&res=0.5&layer=color&layer=normal&layer=id&layer=depth&data={data}"
        found = town.get(f"/studio/scenes/town/estimate.json?{query}").json()
        tiles, images = (int(number.replace(",", "")) for number in re.findall(r"[\d,]+", found["tiles"]))
        assert images == {"png": 4, "tile": 2}[data] * tiles
        sizes[data] = found["size"]
        fields = {"name": data, "directions": "1", "res": "0.5", "layer": ["color", "normal", "id", "depth", "ao"], "data": data}
        assert town.post("/studio/scenes/town/renderings/new", **fields).status_code == 303
    assert sizes["png"] != sizes["tile"]
    catalogue = town.workspace.open_catalogue()
    layers = {data: [layer.name for layer in catalogue.rendering(data).layers] for data in ("png", "tile")}
    catalogue.close()
    assert layers == {"png": ["color", "normal", "id", "depth", "ao"], "tile": ["color", "data", "ao"]}


@pytest.mark.parametrize(
    ("chosen", "stored"), [(["color"], ["color"]), (["id", "sun"], ["data", "sun"]), ([], ["color", "data"]), (["data"], ["color", "data"])]
)
def test_only_chosen_data_is_stored(chosen, stored):
    form = read_form(ImmutableMultiDict([("data", "tile"), *(("layer", kind) for kind in chosen)]))
    assert list(form.stored_layers) == stored


def test_an_unknown_data_is_the_default():
    assert read_form(ImmutableMultiDict([("data", "zip")])).data == read_form(ImmutableMultiDict()).data


def test_rendering_from_the_form_to_the_map_and_away(town):
    fields = {"title": "My map", "directions": "1", "pitch": "60", "res": "0.5", "layer": ["color", "id", "depth", "normal"]}
    response = town.post("/studio/scenes/town/renderings/new", **fields)
    assert (response.status_code, response.headers["location"]) == (303, "../../../../studio/renderings/my-map")
    assert "data-poll" in town.get("/studio/renderings/my-map").text
    assert "thumb" not in town.get("/studio/").text, "nothing is rendered yet"
    town.work()
    page = town.get("/studio/renderings/my-map").text
    assert "100 %" in page
    assert "data-poll" not in page
    assert "Open map" in page
    assert all(f"<li>{name}</li>" in page for name in ("Colour", "Surface directions", "Objects", "Depth")), "not: color, data"
    assert "Files have changed" not in page
    assert town.get("/view/my-map/rendering.json").json()["complete"] is True
    assert town.get("/tiles/my-map/rendering.json").json()["views"][0]["id"] == "0-60"
    for path in ("/studio/", "/studio/scenes/town"):
        (picture,) = re.findall("<img class=.thumb[^>]*>", town.get(path).text)
        assert 'loading="lazy"' in picture
        shown = town.get(urljoin(path, re.search('src="([^"]*)"', picture)[1]))
        assert (shown.status_code, shown.headers["content-type"]) == (200, "image/jpeg")

    texts = {"title": "Old harbour", "attribution": "", "description": "Ships", "start_view": "0 60"}
    assert town.post("/studio/renderings/my-map/change", **texts).status_code == 303
    found = town.get("/view/my-map/rendering.json").json()
    assert (found["title"], found["description"], found["start"]["view"], found["complete"]) == ("Old harbour", "Ships", "0-60", True)
    assert 'value="Old harbour"' in town.get("/studio/renderings/my-map").text
    assert town.post("/studio/renderings/my-map/change", start_view="17 60").status_code == 400

    confirmation = "/studio/scenes/town/files/b/remove"
    link = re.search('href="([^"]*)"[^>]*aria-label="Remove b"', town.get("/studio/scenes/town").text)[1]
    assert urljoin("/studio/scenes/town", link) == confirmation
    asked = town.get(confirmation).text
    assert "what was imported from b.obj" in asked
    assert 'method="post"' in asked
    assert town.get(confirmation.replace("/b/", "/nothing/")).status_code == 404
    town.post(confirmation)
    town.work()
    assert "Files have changed since the last render." in town.get("/studio/renderings/my-map").text
    town.post("/studio/renderings/my-map/render")
    town.work()
    assert "Files have changed" not in town.get("/studio/renderings/my-map").text

    town.post("/studio/renderings/my-map/publish", folder="shown")
    town.work()
    assert (town.workspace.root / "published" / "shown" / "index.html").is_file()
    assert town.post("/studio/renderings/my-map/publish", folder="../../etc").status_code == 400
    other = town.workspace.root / "published" / "other"
    other.mkdir()
    (other / "rendering.json").write_text('{"map3d": "rendering", "name": "harbour", "origin": [0, 0, 0]}')
    refused = town.post("/studio/renderings/my-map/publish", folder="other")
    assert (refused.status_code, "another rendering, harbour" in refused.text, "--replace" in refused.text) == (400, True, False)
    town.post("/studio/renderings/my-map/publish", folder="other", replace="yes")
    town.work()
    assert json.loads((other / "rendering.json").read_text())["name"] == "my-map"
    shutil.rmtree(other)

    assert "published to published/shown" in town.get("/studio/operations/").text
    assert str(town.workspace.root) not in "".join(town.get(path).text for path in ("/studio/operations/", "/studio/", "/studio/renderings/my-map"))
    shown = "/studio/renderings/my-map/published/shown/remove"
    link = re.search('href="([^"]*)"[^>]*aria-label="Remove shown"', town.get("/studio/renderings/my-map").text)[1]
    assert urljoin("/studio/renderings/my-map", link) == shown
    assert "go offline" in town.get(shown).text
    assert town.post(shown, typed="published").status_code == 400
    assert town.get(shown.replace("shown", "nothing")).status_code == 404
    assert town.post(shown, typed="shown").status_code == 303
    town.work()
    assert not (town.workspace.root / "published" / "shown").exists()
    assert "removed published/shown" in town.get("/studio/renderings/my-map").text

    for folder in ("shown", "kept"):
        town.post("/studio/renderings/my-map/publish", folder=folder)
    town.work()
    asked = town.get("/studio/renderings/my-map/remove").text
    assert re.findall('name="published" value="([a-z]+)" checked', asked) == ["kept", "shown"]
    assert 'name="published" value="kept" checked' in town.get("/studio/scenes/town/remove").text
    wrong = town.post("/studio/renderings/my-map/remove", typed="mymap", published="shown")
    assert re.findall('name="published" value="([a-z]+)"( checked)?', wrong.text) == [("kept", ""), ("shown", " checked")], "the choice is kept"
    assert (wrong.status_code, "Nothing was removed" in wrong.text) == (400, True)
    town.work()
    assert town.get("/studio/renderings/my-map").status_code == 200
    assert town.post("/studio/renderings/my-map/remove", typed="my-map", published="shown").status_code == 303
    town.work()
    assert [path.name for path in (town.workspace.root / "published").iterdir()] == ["kept"]
    assert "with published/shown" in town.get("/studio/operations/").text
    assert town.get("/studio/renderings/my-map").status_code == 404
    town.post("/studio/scenes/town/remove", typed="town")
    town.work()
    assert town.get("/studio/scenes/town").status_code == 404


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"res": "0"}, "res is '0'"),
        ({"name": "Bad Name"}, "rendering name"),
        ({"layer": "sun"}, "date and a time"),
        ({"res": "0.000001"}, "res is"),
        ({"directions": "1e9"}, "directions is"),
        ({"quality": "101"}, "quality is '101', expected a whole number from 1 to 100"),
        ({"color": "gif"}, "color is 'gif', expected webp or png or jpeg"),
        ({"window": "1,2"}, "window is '1,2', expected 3 numbers"),
    ],
)
def test_wrong_rendering_is_refused(town, fields, says):
    response = town.post("/studio/scenes/town/renderings/new", **{"res": "0.5", "name": "x", **fields})
    assert response.status_code in (400, 404)
    assert says in unescape(response.text)
    catalogue = town.workspace.open_catalogue()
    assert catalogue.renderings() == []
    catalogue.close()


def test_failed_operation_is_shown_with_its_log_and_can_be_tried_again(studio):
    studio.post("/studio/scenes/new", title="Town", crs="local")
    studio.post("/studio/scenes/town/import", file=studio.upload("broken.obj", b"v 0 0 0\nf 1 2 3\n"))
    studio.work()
    failed = studio.last("import")
    assert failed.state is OperationState.FAILED
    page = studio.get(f"/studio/operations/{failed.id}").text
    assert "Failed" in page
    assert "broken.obj" in page
    assert str(studio.workspace.root) not in page
    assert "Try again" in page
    assert studio.post(f"/studio/operations/{failed.id}/retry").status_code == 303
    assert studio.last("import").state is OperationState.WAITING
    assert studio.post(f"/studio/operations/{failed.id}/cancel").status_code == 303
    assert studio.last("import").state is OperationState.CANCELLED
    assert studio.get("/studio/operations/").status_code == 200
    assert studio.get("/studio/operations/999").status_code == 404


def test_import_without_a_coordinate_system_is_repeated_with_one(studio):
    studio.post("/studio/scenes/new", title="Town", crs="EPSG:25832")
    studio.post("/studio/scenes/town/import", file=studio.upload("a.gml", WITHOUT_CRS))
    studio.work()
    failed = studio.last("import")
    page = studio.get(f"/studio/operations/{failed.id}").text
    assert failed.state is OperationState.FAILED
    assert "Import again" in page
    assert str(studio.workspace.root) not in page.split("<ol")[0], "paths of the server are not shown"
    assert studio.post(f"/studio/operations/{failed.id}/import", crs="EPSG:25832").status_code == 303
    studio.work()
    assert studio.last("import").state is OperationState.DONE
    assert studio.post(f"/studio/operations/{studio.last('build').id}/import").status_code == 400


def test_quarantined_blocks_are_listed_with_their_reasons(town):
    town.post("/studio/scenes/town/renderings/new", name="map", directions="1", pitch="45", res="0.5", layer=["color"])
    town.work()
    catalogue = town.workspace.open_catalogue()
    blocks = [(job.track, job.block) for job in catalogue.jobs("map") if job.kind == "base"]
    catalogue.reopen("map", blocks)
    for _ in range(3):
        lease = catalogue.lease("map", "w")
        catalogue.fail(lease, verbatim("out of memory: 512 MB"))
    catalogue.close()
    page = town.get("/studio/renderings/map").text
    assert "Blocks in quarantine" in page
    assert "out of memory: 512 MB" in page
    town.post("/studio/renderings/map/render", retry="1")
    town.work()
    assert "Blocks in quarantine" not in town.get("/studio/renderings/map").text


def test_viewers_see_pages_without_forms(town):
    add_user(town.workspace, "ben", "viewer")
    viewer = Studio(town.client, town.workspace, add_token(town.workspace, "ben"))
    for path in ("/studio/", "/studio/scenes/town", "/studio/scenes/town/files/a", "/studio/operations/", "/studio/operations/1"):
        page = viewer.get(path)
        assert page.status_code == 200
        main = page.text.split("<main", 1)[1]
        assert "<form" not in main, path
        assert "New " not in main, path
    for path in ("/studio/scenes/new", "/studio/scenes/town/renderings/new", "/studio/scenes/town/preview.jpg", "/studio/scenes/town/remove"):
        assert viewer.get(path).status_code == 403


def test_visitors_are_sent_to_the_sign_in(town):
    for path in ("/studio/", "/studio/scenes/town", "/studio/operations/"):
        assert town.client.get(path).status_code == 401
        asked = town.client.get(path, headers=HTML)
        assert (asked.status_code, asked.headers["location"].lstrip("./")) == (303, f"sign-in?next={path}")


def test_names_and_reports_are_escaped(studio):
    title = '<script>alert("x")</script>'
    studio.post("/studio/scenes/new", title=title, name="town", crs="local", attribution=title)
    for path in ("/studio/", "/studio/scenes/town", "/studio/scenes/town/remove"):
        assert "<script>alert" not in studio.get(path).text


def test_pages_run_no_inline_script_or_style(town):
    """The content security policy would refuse them."""
    paths = (
        "/studio/",
        "/studio/scenes/town",
        "/studio/scenes/new",
        "/studio/scenes/town/renderings/new",
        "/studio/operations/",
        "/account",
        "/sign-in",
    )
    for path in paths:
        text = town.get(path).text
        assert re.findall(r"<script(?![^>]*\bsrc=)[^>]*>", text) == []
        assert re.findall(r"""\s(?:style|on\w+)=["']""", text) == []


def test_links_are_relative(town):
    """They are right behind a proxy that serves the app below a path."""
    for path in ("/studio/", "/studio/scenes/town", "/studio/scenes/town/renderings/new", "/renderings", "/sign-in", "/account"):
        links = re.findall(r"""\s(?:href|src|action|formaction|data-\w+)=["']([^"']+)["']""", town.get(path).text)
        assert [link for link in links if link.startswith(("/", "http"))] == [], path


def test_too_large_form_is_refused_before_it_is_read(studio):
    response = studio.client.request("POST", "/studio/scenes/new", content=b"title=" + b"x" * (3 << 20), headers=studio.headers)
    assert response.status_code == 413
