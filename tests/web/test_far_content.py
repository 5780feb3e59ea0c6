"""The page of a scene names content far from the rest, and editors choose what the map shows."""

from html import unescape

from map3d.scenes.outliers import read_outliers
from tests.odd_cities.strays import write_obj_town
from tests.operations.archives import write_zip
from tests.web.test_studio import studio  # noqa: F401


def kept(studio):  # noqa: F811
    outliers = read_outliers(studio.workspace, "far")
    return outliers.kept, outliers.triangles


def import_two_towns(studio, tmp_path):  # noqa: F811
    studio.post("/studio/scenes/new", title="Far", name="far", crs="local")
    towns = {f"town-{k}.obj": write_obj_town(tmp_path / f"{k}.obj", 4 - k, (200_000.0 * k, 0.0)).read_bytes() for k in (0, 1)}
    packed = write_zip(tmp_path / "towns.zip", towns).read_bytes()
    assert studio.post("/studio/scenes/far/import", file=studio.upload("towns.zip", packed), transparency="as-is").status_code == 303
    studio.work()


def test_the_page_names_what_is_left_out_and_each_choice_is_built(studio, tmp_path):  # noqa: F811
    import_two_towns(studio, tmp_path)
    assert studio.last("import").arguments["options"] == {"transparency": "as-is"}
    page = unescape(studio.get("/studio/scenes/far").text)
    assert kept(studio) == ((1,), 108)
    assert "108 triangles lie far from the rest and are left out:" in page
    assert "town-1.obj: 108 triangles, up to 200 km away: town-1" in page
    assert "1 object, 192 triangles, 128 m × 130 m around 64, 65" in page
    assert page.count("Show this place instead") == 1
    assert "Show the largest place only" not in page
    studio.post("/studio/scenes/far/build", cluster="2")
    studio.work()
    assert kept(studio) == ((2,), 192)
    studio.post("/studio/scenes/far/build", keep_outliers="true")
    studio.work()
    assert kept(studio) == ((1, 2), 0)
    page = unescape(studio.get("/studio/scenes/far").text)
    assert "Content far from the rest is kept." in page
    assert "Keep everything" not in page
    studio.post("/studio/scenes/far/build", cluster="0")
    studio.work()
    assert kept(studio) == ((1,), 108)


def test_a_cluster_that_is_no_number_is_refused(studio):  # noqa: F811
    studio.post("/studio/scenes/new", title="Far", name="far", crs="local")
    for value in ("x", "-1", "1e9", "٣", "9" * 5000):
        assert studio.post("/studio/scenes/far/build", cluster=value).status_code == 400
    assert "far from the rest" not in studio.get("/studio/scenes/far").text
