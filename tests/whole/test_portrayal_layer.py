"""A layer from a 3D Portrayal Service in a browser: from this project's server, and from one that shares no code with it."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.whole.browsing import browse, picture
from tests.whole.core_pixels import CoreView
from tests.whole.other_portrayal_service import BLOCKS, CRS, EAST, NORTH, other_service

pytestmark = pytest.mark.browser

VIEW = "90-45"


def test_a_layer_of_the_service_equals_the_pyramid(workspace: Path, origin: str) -> None:
    view = CoreView(workspace, "town", VIEW)
    objects = view.find_objects("building", 3)
    middle = objects[0].position
    answer = browse(
        "portrayal_layer.mjs",
        origin=origin,
        rendering="town",
        service=f"{origin}/3dps",
        view=VIEW,
        targets=[(middle, view.frame.zmax), (middle, view.frame.zmax - 2)],
        positions=[place.position for place in objects],
        size=(800, 600),
        picture=picture("portrayal-layer.png"),
    )
    assert answer["requests"]["COLOR,NORMAL"] > 0
    assert answer["requests"]["GetFeatureInfoByObjectId"] == len(objects)
    assert answer["problems"] == []
    assert answer["errors"] == []
    assert answer["missing"] == []
    assert [shot["differing"] for shot in answer["shots"]] == [0] * 10
    assert min(shot["colours"] for shot in answer["shots"]) > 5
    assert answer["light"]["changed"] > 10_000
    assert answer["light"]["differing"] == 0
    from_tiles, from_service = answer["picks"]
    for place, tiled, served in zip(objects, from_tiles, from_service, strict=True):
        assert (served["id"], served["name"], served["kind"], served["approximate"]) == (place.id, place.name, tiled["kind"], False)
        assert np.linalg.norm(np.array(served["position"]) - tiled["position"]) < 1e-6
        assert tiled["attributes"].items() <= served["attributes"].items()


FAULTS = {
    "exception": r"PortrayalError: .*GetView of .*: the service answers StyleNotDefined \(styles\): No <thanks>",
    "exception-200": r"PortrayalError: .*: the service answers NoApplicableCode: No <thanks>",
    "blank": r"PortrayalError: .*: expected image/png of 256 × 256 pixels, got an answer without content",
    "no-content": r"PortrayalError: .*, got an answer without content",
    "html": r"PortrayalError: .*, got text/html of 16 bytes",
    "octets": r"PortrayalError: .*, got application/octet-stream of \d+ bytes",
    "disguised": r"PortrayalError: .*, got something else that is declared as image/png",
    "cut": r"PortrayalError: .*, got an image that is cut after \d+ bytes",
    "huge": r"FetchError: .*: the answer has \d+ bytes, the limit is 589824",
    "size": r"PortrayalError: .*, got 128 × 256 pixels",
    "missing": r"FetchError: .*: HTTP 404",
    "document-doctype": r"PortrayalError: .*GetCapabilities: the XML has a document type declaration",
    "document-malformed": r"PortrayalError: .*: the answer is not well-formed XML",
    "document-other": r"PortrayalError: .*: expected the capabilities of a 3D Portrayal Service, got the element WMS_Capabilities",
    "document-exception": r"PortrayalError: .*: the service answers VersionNegotiationFailed \(acceptVersions\)",
    "document-huge": r"FetchError: .*: the answer has \d+ bytes, the limit is 16777216",
    "document-perspective": r"PortrayalError: .*: the service does not offer the orthographic projection",
    "document-feet": r"PortrayalError: .*: the bounding box of layer blocks,1 is 144 units wide, but 87\d m by its longitudes and latitudes",
    "document-scene": r"PortrayalError: .*: the service does not offer GetView",
    "document-no-cors": r"FetchError: .*: no complete answer .*Access-Control-Allow-Origin",
}
"""What the map says, by kind of fault."""


def test_layers_of_another_makers_service() -> None:
    hall, tower = BLOCKS[1], BLOCKS[2]
    places = [hall.roof, tower.roof]
    with other_service() as address:
        answer = browse(
            "other_service.mjs",
            hosts={"other.test": address},
            page=f"http://{address}/",
            shown=[
                {"service": "http://other.test/plain", "options": {}, "view": "90-45", "zoom": 1, "places": places},
                {"service": "http://other.test/full", "options": {"views": ["30-60"]}, "view": "30-60", "zoom": 2, "places": places},
                {
                    "service": "http://other.test/full",
                    "options": {"views": ["45-90"], "colorFormat": "image/jpeg"},
                    "view": "45-90",
                    "zoom": 2,
                    "places": places,
                },
            ],
            faults=[],
            pictures=[picture(f"other-service-{k}.png") for k in range(3)],
            size=(800, 600),
        )
    plain, full, above = answer["shown"]
    for shown in answer["shown"]:
        assert (shown["crs"]["epsg"], shown["crs"]["name"], shown["title"], shown["attribution"]) == (31468, CRS, "Blocks", "Büro für Klötze")
        assert shown["origin"] == [EAST, NORTH, 519]
        for block, seen in zip((hall, tower), shown["seen"], strict=True):
            assert np.abs(np.array(seen["color"][:3]) - block.color).max() <= 6, (block.name, seen["color"])

    # A service of colours alone shows a map, and says what it lacks.
    assert (plain["layers"], plain["missing"]) == ([["color", "opaque"]], ["normal", "id", "depth"])
    assert [(seen["id"], seen["position"]) for seen in plain["seen"]] == [(0, None)] * 2
    assert plain["errors"] == ['mode "normal" needs the layer normal, which the rendering "blocks,1" lacks']
    said = "map3d: http://other.test/plain offers no usable NORMAL, OBJECTID, DEPTH images: no light; no picking, highlights or styles; no positions"
    assert [problem.startswith(said) for problem in answer["problems"]] == [True]

    # With all image layers, objects are picked, measured and lit.
    assert (full["missing"], full["errors"], above["errors"]) == ([], [], [])
    assert (full["layers"], above["layers"][0]) == ([["color", "png"], ["normal", "png"], ["id", "png"], ["depth", "png"]], ["color", "jpeg"])
    for shown in (full, above):
        for block, seen in zip((hall, tower), shown["seen"], strict=True):
            assert (seen["id"], seen["name"], seen["kind"], seen["approximate"]) == (block.id, block.name, "Block", False)
            assert seen["attributes"] == [["height", str(block.high[2])], ["__proto__", "x"]]
            assert np.abs(np.array(seen["position"]) - block.roof).max() <= 0.15
    noon, evening = (np.array(pixel[:3]) for pixel in full["light"])
    assert (noon - evening > 20).any()


@pytest.mark.parametrize("of_documents", [False, True])
def test_faults_of_a_service_are_one_clear_error(of_documents: bool) -> None:
    kinds = {kind: expected for kind, expected in FAULTS.items() if kind.startswith("document-") == of_documents}
    with other_service() as address:
        addresses = [f"http://other.test/faults/{kind}" for kind in kinds]
        answer = browse("other_service.mjs", hosts={"other.test": address}, page=f"http://{address}/", shown=[], faults=addresses, size=(300, 200))
    for (kind, expected), (name, message) in zip(kinds.items(), answer["faults"], strict=True):
        assert re.match(expected, f"{name}: {message}"), (kind, name, message)
