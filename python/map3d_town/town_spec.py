"""The specification of a town, and a rough estimate of its size."""

from collections.abc import Collection
from dataclasses import asdict, dataclass, field

from pyproj import CRS

from map3d_town.town_errors import TownError

STYLES = ("town", "roman")
FORMATS = ("citygml", "obj")
MOST_BUILDINGS = 2_000_000
BYTES_PER_TEXEL = 0.3
BYTES_PER_BUILDING = {"citygml": 40_000, "obj": 26_000}
BYTES_PER_DEEP_BUILDING, SHARED_BYTES = 62_000, 900_000
BYTES_PER_ORTHO_PX, BYTES_PER_DEM_PX, BYTES_PER_TREE = 0.24, 1.4, 740
AREA_PER_BUILDING_M2 = 900.0


@dataclass(frozen=True)
class TownEstimate:
    """Disk space and counts of a town. `textures`: number of atlases; `ortho_side_px`: 0 without terrain; `extent_m`: side of the square."""

    disk_bytes: int
    files: int
    textures: int
    ortho_side_px: int
    extent_m: float


@dataclass(frozen=True)
class TownSpec:
    """The specification of a town. Equal specs give equal bytes.

    `style`: "town" (European) or "roman". `buildings`: number of buildings, exact for "town", at most for "roman". `files`: number of
    CityGML files. `texture_px`: side of an atlas; None: 512 below 100 buildings, else 1024. `textures`: number of atlases; None: one per
    `buildings_per_texture` buildings. `deep_share`: share of houses whose windows and doors are modelled and recessed. `ortho_m`, `dem_m`:
    pixel sizes; None: depends on the extent. `ortho_px`: minimum side of the orthophoto; reduces its pixel size. `east_m`, `north_m`,
    `height_m`: position of the centre in `crs`.
    """

    style: str = "town"
    buildings: int = 300
    seed: int = 1
    files: int = 1
    texture_px: int | None = None
    textures: int | None = None
    buildings_per_texture: int = 2
    formats: Collection[str] = field(default=("citygml",))
    terrain: bool = True
    trees: bool = True
    deep_share: float = 0.25
    ortho_m: float | None = None
    ortho_px: int | None = None
    dem_m: float | None = None
    crs: str = "EPSG:25832"
    east_m: float = 691_000.0
    north_m: float = 5_336_000.0
    height_m: float = 500.0
    name: str = "Lindenbrunn"

    def __post_init__(self) -> None:
        object.__setattr__(self, "formats", tuple(sorted(set(self.formats))))
        rules = [
            (self.style in STYLES, "style", self.style, f"one of {', '.join(STYLES)}"),
            (1 <= self.buildings <= MOST_BUILDINGS, "buildings", self.buildings, f"1 to {MOST_BUILDINGS}"),
            (1 <= self.files <= self.buildings, "files", self.files, "1 to the number of buildings"),
            (bool(self.formats) and set(self.formats) <= set(FORMATS), "formats", ", ".join(self.formats), f"one or more of {', '.join(FORMATS)}"),
            (64 <= self.atlas_px <= 16384, "texture_px", self.texture_px, "64 to 16384"),
            (self.textures is None or 1 <= self.textures <= self.buildings, "textures", self.textures, "1 to the number of buildings"),
            (self.buildings_per_texture >= 1, "buildings_per_texture", self.buildings_per_texture, "at least 1"),
            (0 <= self.deep_share <= 1, "deep_share", self.deep_share, "0 to 1"),
            (self.crs.startswith("EPSG:") and self.crs[5:].isdigit(), "crs", self.crs, "a code such as EPSG:25832"),
        ]
        for valid, name, got, expected in rules:
            if not valid:
                raise TownError(f"{name} is {got!r}, expected {expected}")

    @property
    def atlas_px(self) -> int:
        return self.texture_px or (512 if self.buildings < 100 else 1024)

    @property
    def texture_count(self) -> int:
        """Maximum number of atlases of the town."""
        return self.textures or -(-self.buildings // self.buildings_per_texture)

    @property
    def srs_name(self) -> str:
        return f"urn:ogc:def:crs:EPSG::{self.crs[5:]}"

    @property
    def projected_epsg(self) -> int:
        """EPSG code of the horizontal CRS. Raises TownError if that is not projected."""
        crs = CRS.from_epsg(int(self.crs[5:]))
        flat = crs.sub_crs_list[0] if crs.is_compound else crs
        code = flat.to_epsg()
        if not flat.is_projected or code is None:
            raise TownError(f"crs is {self.crs!r}, expected a projected CRS such as EPSG:25832")
        return int(code)

    @property
    def extent_m(self) -> float:
        """Approximate side of the town's square."""
        return float((self.buildings * AREA_PER_BUILDING_M2) ** 0.5 * 1.25 + 180)

    def ortho_pixel_m(self, extent_m: float) -> float:
        """Returns the pixel size of the orthophoto of a square of `extent_m`."""
        pixel = self.ortho_m or (0.1 if extent_m < 700 else 0.2 if extent_m < 4000 else 0.25)
        return min(pixel, extent_m / self.ortho_px) if self.ortho_px else pixel

    def dem_pixel_m(self, extent_m: float) -> float:
        return self.dem_m or (1.0 if extent_m < 4000 else 2.0)

    def estimate(self) -> TownEstimate:
        """Estimates roughly, within a factor of two; `estimate_town` is within 15 % but slower."""
        size = SHARED_BYTES + self.atlas_px**2 * self.texture_count * BYTES_PER_TEXEL * len(self.formats)
        size += sum(BYTES_PER_BUILDING[f] * self.buildings for f in self.formats)
        size += BYTES_PER_DEEP_BUILDING * self.buildings * self.deep_share * len(self.formats)
        ortho = round(self.extent_m / self.ortho_pixel_m(self.extent_m)) if self.terrain else 0
        dem = self.extent_m / self.dem_pixel_m(self.extent_m) if self.terrain else 0
        size += ortho**2 * BYTES_PER_ORTHO_PX + dem**2 * BYTES_PER_DEM_PX
        size += 2.5 * self.buildings * BYTES_PER_TREE * self.trees
        files = self.texture_count + self.files + 2 * self.terrain + self.trees + self.buildings * ("obj" in self.formats)
        return TownEstimate(int(size), files, self.texture_count, ortho, self.extent_m)

    def to_json(self) -> dict[str, object]:
        """Returns the spec as stored in town.json."""
        return {**asdict(self), "formats": list(self.formats)}
