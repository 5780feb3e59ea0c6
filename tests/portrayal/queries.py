"""Queries of the tests' scenes."""

from tests.portrayal.villages import EAST, NORTH

POC = f"{EAST + 50},{NORTH - 300},400"
POI = f"{EAST + 50},{NORTH + 50},10"
ORTHOGRAPHIC = f"Orthographic,{POC},{POI},0,0,1,-100,100,-75,75,,"
PERSPECTIVE = f"Perspective,{POC},{POI},0,0,1,60,,,"


def get_view(
    *,
    width: object = 200,
    height: object = 150,
    projection: str = ORTHOGRAPHIC,
    layers: str = "COLOR",
    formats: str = "image/png",
    more: str = "",
    scene: str = "village",
    crs: str = "EPSG:25832",
    portrayals: str | None = None,
) -> str:
    one = f"WIDTH={width};HEIGHT={height};PROJECTION={projection};IMAGELAYERS={layers};FORMATS={formats}"
    return f"request=GetView&crs={crs}&layers={scene}&portrayals={portrayals or one}{more}"
