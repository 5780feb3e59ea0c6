"""The request for a site: everything from a folder of files to a publication. Only the command line has it."""

from dataclasses import dataclass
from pathlib import Path

from map3d.geometry.views import DEFAULT_PITCH_DEG, views_around
from map3d.requests.heights import HeightChoice
from map3d.requests.param import param
from map3d.requests.publications import replace_param
from map3d.requests.reading import FormatOptions, crs_param
from map3d.requests.renderings import DEFAULT_DIRECTIONS, MapTexts, color_param, data_param, res_param, small_param
from map3d.requests.scenes import ContentChoice, WorkLimits
from map3d.types import DEFAULT_DATA, DataEncoding, ViewAngles


@dataclass(frozen=True, kw_only=True)
class Site(MapTexts, FormatOptions, HeightChoice, ContentChoice, WorkLimits):
    """Turns all files of a folder into a static web site. On a later run, None leaves what the rendering is as it is; what is given is changed."""

    folder: Path = param(help="Folder of the files.", argument=True)
    out: Path = param(help="Output folder of the site.", option="-o/--out")
    replace: bool = replace_param()
    name: str = param("", help="Name of scene and rendering.", words="from the folder")
    views: tuple[ViewAngles, ...] = param(
        (),
        help="Look-at angle and pitch.",
        example="45-22.5",
        words=f"{DEFAULT_DIRECTIONS} angles, pitch {DEFAULT_PITCH_DEG:g}",
        option="--view",
    )
    res_m: float | None = res_param("", words="as fine as textures and triangles, coarser for large scenes, so that rendering takes minutes")
    color: str | None = color_param("layer color", None)
    data: DataEncoding | None = data_param(None, words=DEFAULT_DATA)
    small: bool | None = small_param(None, option="--small/--no-small")
    crs: str | None = crs_param()
    strict: bool = param(False, help="Stop at the first problem instead of skipping it.")
    allow_empty: bool = param(False, help="Remove files from the site even if the folder that they came from is empty now.")
    ao: bool | None = param(None, help="Render ambient occlusion.", words="where textures cover less than a tenth", option="--ao/--no-ao")

    def angles(self) -> tuple[ViewAngles, ...]:
        return self.views or views_around(DEFAULT_DIRECTIONS, (DEFAULT_PITCH_DEG,))
