"""The compiled core, `crates/map3d-py`: a thin binding of the Rust crates. Long calls release the GIL.

Documents pass as JSON text, arrays as NumPy, frames as `Frame`. Errors: `CoreError` and its leaves below.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, final

import numpy as np
from numpy.typing import NDArray

__version__: str
RENDER_FORMAT: int
"""Raised only when rendered bytes change."""
SCENE_VERSIONS: tuple[int, int]
"""Versions of the files of a built scene: chunks and instances, textures."""

# -- limits (spec/limits.json) --------------------------------------------------------------------------------------------------------

TILE_PX: tuple[int, int]
"""Allowed sides of a tile."""
DEEPEST_LEVEL: int
QUALITY: tuple[int, int]
"""Minimum and maximum quality of a lossy colour format."""
MAX_FROM_ORIGIN_M: float
"""Content farther from the scene's origin, along any axis, is never part of a scene."""
MAX_SUNS: int
"""Maximum number of suns of a sun16 layer."""
LAYERS: str
"""The table of spec/layers.json (JSON), in its order."""
AO_RADIUS_M: tuple[float, float]
"""Minimum and maximum radius of ambient occlusion."""
NAME_PATTERN: str
"""Pattern of a whole name of a scene, asset, rendering or layer."""
MESSAGES: str
"""spec/messages.json."""
OBJECTS_PER_SHARD: int
"""Objects whose attributes share a file."""
HEAD_BYTES: int
"""Length of the beginning of a file by which its format is detected."""
READER_VERSIONS: dict[str, int]
"""Versions of the readers by the names of their formats; raised when a reader makes another asset of the same file."""

# -- errors ---------------------------------------------------------------------------------------------------------------------------

class CoreError(Exception): ...

class FormatError(CoreError):
    """A file is truncated or malformed, or has another magic, version or checksum."""

class SceneRebuilt(FormatError):
    """A file of a scene is not the one that the opened index names: the scene was rebuilt meanwhile."""

class LimitError(CoreError):
    """The input exceeds a limit; the message names the limit, its value and what was found."""

class InvalidArgument(CoreError):
    """A caller's misuse."""

class StorageError(CoreError):
    """Reading or writing a file failed (message has path and cause)."""

# -- reading: source documents → batches (map3d-read) ----------------------------------------------------------------------------

@final
class Batch:
    """Triangles of one or more objects, in source order."""
    @property
    def positions(self) -> NDArray[np.float64]:
        """(n, 3) source coordinates; a copy."""
    def set_positions(self, positions: NDArray[np.float64]) -> None:
        """Replaces the positions, e.g. by reprojected ones. Same shape."""
    @property
    def prototype(self) -> bool:
        """True: the positions are in a prototype's own frame, not in the source's CRS."""
    @property
    def crs(self) -> int:
        """Index of the coordinate system of the positions among `Reader.crs_names`."""
    @property
    def triangle_count(self) -> int: ...

@final
class Reader:
    """One source document, parsed as it is iterated. `format`: a name in READER_VERSIONS.

    options (JSON): {"transparency": "auto"|"as-is"|"inverted", "strict": bool, "max_image_side_px": 16384, … further limits}, of OBJ also
    {"up": "y"|"z", "split": "file"|"group"}, of CityGML {"theme": str|null (null: the one with the most textures), "lod": str|null (null: best per
    object), "interiors": bool, "at": date|null (null: today), "appearance_files": [path, …]}; those of another format raise InvalidArgument
    transform: (source, target, [(x, y), …]) → [(x, y), …] from one coordinate system to another, both as documents write them; None if there is
    no transformation. It places textures that are in another one than their surfaces.
    """
    def __init__(
        self,
        path: str,
        format: str,
        options: str = "{}",
        transform: Callable[[str, str, list[list[float]]], list[tuple[float, float]] | None] | None = None,
    ) -> None: ...
    @property
    def srs_name(self) -> str | None:
        """The CRS as the source writes it; known before the first batch if the source names it in its header, else after the last."""
    def __iter__(self) -> Iterator[Batch]: ...
    def __next__(self) -> Batch: ...
    def instances(self) -> NDArray[np.float64]:
        """Returns (m, 12) transforms of the instances, row-major 3 × 4, prototype → source CRS; complete after the last batch."""
    def instance_crs(self) -> NDArray[np.uint16]:
        """Returns the (m,) indices of the instances' coordinate systems among `crs_names`, before `set_instances`; complete after the last batch."""
    def crs_names(self) -> list[str | None]:
        """Returns the coordinate systems that parts of the document are in, as it writes them; the first is the document's. Known for each batch when
        it is returned."""
    def grids(self) -> str:
        """Returns the raster files with the heights of reliefs (JSON); complete after the last batch. A list of {"object": str, "file": path, "columns",
        "rows", "first": [x, y], "column_step": [dx, dy], "row_step": [dx, dy], "crs": str|null}, in the order of axes of the document."""
    def set_instances(self, transforms: NDArray[np.float64]) -> int:
        """Replaces all transforms; removes the instances whose transforms are not finite and returns their number."""
    def report(self) -> str:
        """Returns report.json so far (spec/scene.md)."""

@final
class AssetWriter:
    """Writes an asset folder (spec/scene.md): mesh.m3a, materials.json, objects.jsonl, textures/, report.json."""
    def __init__(self, folder: str) -> None: ...
    def append(self, batch: Batch) -> None: ...
    def append_mesh(
        self, positions: NDArray[np.float64], triangles: NDArray[np.uint32], uvs: NDArray[np.float32] | None, material: int, object: int, rank: int
    ) -> None:
        """Appends a mesh made in Python: positions (n, 3) world, triangles (t, 3), uvs (t, 3, 2) or None."""
    def set_tables(self, materials: str, objects: str) -> None:
        """Sets the tables of an asset made in Python: materials.json and a JSON list of objects. The caller puts images into textures/."""
    def finish(self, reader: Reader | None = None) -> str:
        """Closes the files and returns report.json. Writes the reader's tables and textures; without a reader, those of `set_tables`."""

@final
class AssetMesh:
    """The mesh.m3a of an asset folder, mapped and checked. Arrays are copies, as imported; raises FormatError."""
    def __init__(self, path: str) -> None: ...
    @property
    def positions(self) -> NDArray[np.float64]:
        """(nv, 3) world coordinates, those of a prototype in its own frame."""
    @property
    def triangles(self) -> NDArray[np.uint32]:
        """(nt, 3) vertex numbers."""
    @property
    def uvs(self) -> NDArray[np.float32]:
        """(nt, 3, 2) texture coordinates of the corners."""
    @property
    def materials(self) -> NDArray[np.uint32]:
        """(nt,) indices into the asset's materials."""
    @property
    def objects(self) -> NDArray[np.uint32]:
        """(nt,) indices into the asset's objects."""
    @property
    def prototypes(self) -> NDArray[np.uint32]:
        """(nt,) numbers of prototypes; 0 for world geometry."""
    def placed(self, object: int, transform: Sequence[float]) -> list[float] | None:
        """Returns the transform of an instance of an object as drawn, row-major 3 × 4; None if the object is left out."""
    def boxes(self, count: int, extent: str | None = None) -> tuple[list[_Box | None], dict[int, _Box], list[int]]:
        """Returns the boxes of `count` objects as drawn, in world coordinates, without placed prototypes, None if empty; those of prototypes in
        their own frame; and for each object the number of triangles outside the extent (JSON of `find_clusters`), which its box does not include."""

@final
class Survey:
    """The objects of an asset folder as imported, each without its children: arrays with an entry for each. Stored beside the mesh (spec/scene.md)."""
    def __init__(self, folder: str) -> None: ...
    @property
    def classes(self) -> list[str]: ...
    @property
    def lods(self) -> list[str]:
        """Levels of detail; the first is empty."""
    @property
    def boxes(self) -> NDArray[np.float64]:
        """(n, 2, 3) low and high corners, world coordinates, placed prototypes included; infinite, low above high, without geometry."""
    @property
    def names(self) -> NDArray[np.uint64]:
        """(n,) hashes of names; 0 without one."""
    @property
    def contents(self) -> NDArray[np.uint64]:
        """(n,) hashes of the geometry to the millimetre; 0 without any."""
    @property
    def triangles(self) -> NDArray[np.uint32]: ...
    @property
    def parents(self) -> NDArray[np.int64]:
        """(n,) numbers of the parents; -1 at the top."""
    @property
    def class_numbers(self) -> NDArray[np.uint16]:
        """(n,) indices into `classes`."""
    @property
    def lod_numbers(self) -> NDArray[np.uint16]:
        """(n,) indices into `lods`."""
    @property
    def flags(self) -> NDArray[np.uint32]:
        """(n,) bit 0: some triangle is textured; bit 1: the object has placed prototypes."""

@final
class Surface:
    """A surface of the ground."""
    @staticmethod
    def of_asset(folder: str, objects: NDArray[np.bool_], is_adjusted: bool) -> Surface:
        """The triangles of those objects of an asset folder for which `objects`, (n,), is true; as drawn, else as imported."""
    @staticmethod
    def of_mesh(positions: NDArray[np.float64], triangles: NDArray[np.uint32]) -> Surface:
        """positions (n, 3) world, triangles (t, 3)."""

def surface_heights(surfaces: Sequence[Surface], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the (n,) heights of the highest surface at (n, 2) points in world coordinates, NaN where there is none."""

def drape_objects(folder: str, bases: NDArray[np.float64], scale: float, surfaces: Sequence[Surface], fallback: Surface | None = None) -> int:
    """Writes draped.m3a of an asset folder, which stands for the objects with a base; returns the number of its triangles. `bases`: (n,) the height of
    each object that lies on the ground, NaN for objects that are not draped; `fallback`: ground where the surfaces have none."""

def write_adjustments(folder: str, scale: float, shifts: NDArray[np.float64]) -> None:
    """Writes adjustments.m3h of an asset folder: heights as drawn are z · scale + the shift of the object; objects with NaN are left out."""

def read_adjustments(folder: str) -> tuple[float, NDArray[np.float64]] | None:
    """Returns the scale and the (n,) shifts of an asset folder; None if it is drawn as imported."""

def detect_format(head: bytes) -> str | None:
    """Returns the name of the format of the document that begins so. `head`: the first HEAD_BYTES of the file, unpacked, or all."""

def xml_root(head: bytes) -> str | None:
    """Returns the local name of the first element of XML, empty without one; None for anything else."""

def utf16_encoding(head: bytes) -> Literal["UTF-16LE", "UTF-16BE"] | None:
    """Returns the encoding if a text is in UTF-16, with a byte order mark or without; None for any other. `head`: its first bytes."""

def texture_map_name(statement: bytes) -> str | None:
    """Returns the file name in a `map_…` statement of a material library. `statement`: what follows the keyword."""

@final
class FileFinder:
    """Finds the files that documents name, as the readers do."""
    def __init__(self, base: str, root: str | None = None) -> None:
        """`base`: folder to which names are relative; `root`: folder that they may lead into, by default `base`. Raises StorageError."""
    def find(self, name: str) -> tuple[Path | None, bool]:
        """Returns the file of a name as the document writes it, None if there is none; and whether the name is that of a file rather than a URL."""
    def library_names(self, statement: bytes) -> list[str]:
        """Returns the names of the files of a `mtllib` statement of an OBJ file. `statement`: what follows the keyword."""

def check_file(path: str) -> None:
    """Raises FormatError unless a mesh, chunk, instance or texture file has a known version and the checksum of its header."""

# -- build: assets → chunks and textures (map3d-build) ---------------------------------------------------------------

Progress = Callable[[str, int, int], bool]
"""(stage, done, total) → False to stop; the build then raises `Interrupted` and keeps finished files."""

class Interrupted(CoreError):
    """A callback asked to stop; finished files stay."""

def build_scene(folder: str, request: str, progress: Progress | None = None) -> str:
    """Builds chunks/, textures/, instances.m3i and scene.json of a scene folder from its assets; returns the report (JSON). Unchanged chunks and textures are kept.

    request: {"assets": ["name", …], "origin": [x,y,z], "options": {"merge_vertices": true, "merge_faces": true, "drop_degenerate": true,
    "merge_materials": true, "drop_untextured": false, "ground_plane": "auto"|"on"|"off", "keep_outliers": false, "cluster": 0}, "ground_id": u32, "threads": n, "max_memory_bytes": n}
    """

def find_damaged_images(folder: str, threads: int = 0) -> str:
    """Decodes all images of an asset; returns those that cannot be used, by their keys: {key: {"code", "values"}} (JSON), a message each.
    `threads` = 0: one per core."""

def find_clusters(folders: list[str], origin: _Vec3, options: str) -> str:
    """Returns where the content of asset folders is (JSON): {"clusters": [{"box", "triangles", "objects"}], largest first; "extent" of what a scene
    with these options and this origin keeps, null for everything; "outside": numbers of the folders with content outside the extent}. Measures
    folders that have no cells.json, and writes it. Raises InvalidArgument for a cluster that does not exist."""

# -- tracing and blocks (map3d-trace, map3d-render) --------------------------------------------------------------------------------

_Format = Literal["webp", "png", "jpeg", "m3d"]
"""m3d: the data tile, for the kind data, which holds normal, id and depth."""
_Vec3 = tuple[float, float, float]
_Box = tuple[_Vec3, _Vec3]

@final
class LayerSpec:
    """How a layer is made and encoded. `suns`: unit vectors towards the suns; `radius_m`: of ambient occlusion."""
    def __init__(
        self, kind: str, format: _Format, quality: int = 80, small: bool = False, suns: Sequence[Sequence[float]] = ..., radius_m: float = 0.0
    ) -> None: ...
    @property
    def kind(self) -> str: ...
    @property
    def format(self) -> _Format: ...
    @property
    def quality(self) -> int: ...
    @property
    def small(self) -> bool: ...
    @property
    def suns(self) -> list[_Vec3]: ...
    @property
    def radius_m(self) -> float: ...

@final
class Frame:
    """A view's pinned frame (spec/pyramid.md §2) with the layers of a pass. Immutable and valid: raises InvalidArgument."""
    def __init__(
        self,
        look_at_deg: float,
        pitch_deg: float,
        u0_m: float,
        v0_m: float,
        d0_m: float,
        size_m: float,
        tile_px: int,
        zmax: int,
        layers: Sequence[LayerSpec] = ...,
    ) -> None: ...
    @property
    def look_at_deg(self) -> float: ...
    @property
    def pitch_deg(self) -> float: ...
    @property
    def u0_m(self) -> float: ...
    @property
    def v0_m(self) -> float: ...
    @property
    def d0_m(self) -> float: ...
    @property
    def size_m(self) -> float: ...
    @property
    def tile_px(self) -> int: ...
    @property
    def zmax(self) -> int: ...
    @property
    def layers(self) -> list[LayerSpec]: ...

@final
class Camera:
    """A view of any kind (spec/cameras.md), from any position, direction and roll, also level and from below; valid.

    Local axes and metres. `position`: the point of the camera. `right`, `up`, `forward`: orthonormal to within 1e-6, right × forward = up. `window`: the
    edges (left, right, bottom, top) of the image in the plane through the point of the camera, from that point: metres in orthographic views, tangents
    (metres at distance 1 m) in perspective. Only what is between `near_m` and `far_m` along `forward` is drawn; `near_m` may be negative in orthographic
    views and is at least 0.001 in perspective. Sides of the image: 1 to 4096 px. Raises InvalidArgument for other numbers."""
    def __init__(
        self,
        projection: Literal["orthographic", "perspective"],
        position: _Vec3 | Sequence[float],
        right: _Vec3 | Sequence[float],
        up: _Vec3 | Sequence[float],
        forward: _Vec3 | Sequence[float],
        window: tuple[float, float, float, float],
        near_m: float,
        far_m: float,
        width_px: int,
        height_px: int,
    ) -> None: ...
    @property
    def projection(self) -> Literal["orthographic", "perspective"]: ...
    @property
    def position(self) -> _Vec3: ...
    @property
    def right(self) -> _Vec3:
        """Exactly orthonormal, like `up` and `forward`."""
    @property
    def up(self) -> _Vec3: ...
    @property
    def forward(self) -> _Vec3: ...
    @property
    def window(self) -> tuple[float, float, float, float]: ...
    @property
    def near_m(self) -> float: ...
    @property
    def far_m(self) -> float: ...
    @property
    def width_px(self) -> int: ...
    @property
    def height_px(self) -> int: ...
    def line_of_sight(self, x_px: float, y_px: float) -> tuple[_Vec3, _Vec3]:
        """Returns the line of sight through a point of the image, in pixels right and down from its top left corner: a local point in the camera's plane,
        and the direction, which advances one metre along `forward`."""

@final
class Scene:
    """A built scene, opened for tracing: chunks are mapped on demand, textures cached up to `cache_bytes`. Threads may share it."""
    def __init__(self, folder: str, cache_bytes: int = 536870912) -> None: ...
    @property
    def origin(self) -> _Vec3:
        """World coordinates of the local origin."""
    @property
    def box(self) -> _Box:
        """Local box of all content; zeros for an empty scene."""
    @property
    def triangle_count(self) -> int:
        """Triangles of all chunks and prototypes; a prototype counts once."""
    def sample_surfaces(self) -> tuple[NDArray[np.uint32], NDArray[np.float64], NDArray[np.float64]]:
        """Returns the object, the area in square metres and the side of a texel in metres, NaN without a texture, of triangles spread evenly over the
        scene; always the same ones."""
    def occupied(self, frame: Frame, level: int, within: tuple[int, NDArray[np.uint32]] | None = None) -> NDArray[np.uint64]:
        """Returns the tiles of a level that may have content, as sorted Morton numbers. `within`: a level above and (n, 2) columns and rows of its
        blocks; only their tiles are examined. Time and memory grow with the occupied tiles, not with the level."""
    def block_keys(self, frame: Frame, z: int, blocks: NDArray[np.uint32], device: str = ...) -> list[str]:
        """Returns the keys of the blocks of level z at (n, 2) columns and rows: hex hashes over everything that a base block's bytes depend on.
        `device`: class of devices that render."""
    def block_key(self, frame: Frame, z: int, x: int, y: int, device: str = ...) -> str:
        """Returns the key of the block at (z, x, y)."""
    def render_block(self, frame: Frame, z: int, x: int, y: int) -> Block:
        """Renders the base block rooted at (z, x, y)."""
    def gbuffer(self, frame: Frame, x: int, y: int) -> dict[str, NDArray[Any]]:
        """Renders one base tile's G-buffer (spec/pyramid.md §5): id, depth and the arrays of the frame's layers; color, normal, id, depth without any."""
    def render_view(
        self,
        camera: Camera,
        layers: Sequence[LayerSpec],
        *,
        samples: int = 16,
        threads: int = 1,
        deadline_s: float | None = None,
        box: _Box | None = None,
        objects: NDArray[np.uint32] | None = None,
        region: tuple[int, int, int, int] | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Renders any view by the rules of tiles (spec/pyramid.md §4, spec/cameras.md). Returns an array per layer; color, normal, id and depth for none.

        color, picture (h, w, 4) uint8 sRGB with straight alpha, 0 where nothing is; normal (h, w, 3) uint8 as spec/pyramid.md §6 codes it; id (h, w) uint32;
        depth (h, w) float32, metres along `camera.forward`, NaN where nothing is; sun, ao (h, w) uint8. id, depth and normal are those of the pixel's centre,
        colours the mean of `samples` (1, 4 or 16) per pixel. Formats and qualities of the layers are ignored; kinds that no view has are refused.

        `box`: only geometry inside this local box is drawn, cut at its sides. `objects`: only these ids are drawn. Light (sun, ao, picture) is that of the
        whole scene in both cases. `region`: (x, y, width, height) of the image, in pixels; the arrays have its size. The bytes are the same for any
        `threads`. Raises LimitError once `deadline_s` has passed, InvalidArgument for other misuse; signals such as Ctrl-C stop it within about a tenth of a
        second."""
    def pick_ray(
        self,
        camera: Camera,
        x_px: float,
        y_px: float,
        count: int = 1,
        *,
        box: _Box | None = None,
        objects: NDArray[np.uint32] | None = None,
    ) -> list[tuple[int, float, _Vec3, _Vec3]]:
        """Returns the first `count` (at most 10,000) surfaces on the line of sight through a point of the image, in pixels right and down from its top left
        corner (pixel centres at +½): (id, metres along the line of sight from the camera's plane or, in perspective, its point, local position, unit normal
        of the visible side) of each, nearest first. Near and far distance, `box` and `objects` limit them as in `render_view`."""
    def object_box(self, id: int) -> _Box | None:
        """Returns the local box of an object; None when the scene does not have it."""
    def stats(self) -> dict[str, int]:
        """Hits, misses and bytes of the caches of chunks and textures."""
    def view_times(self) -> dict[str, float]:
        """Returns the seconds of the threads' CPU time that all views so far took, by stage: visibility, shade, light, convert. Opening chunks is part of
        visibility, reading and decoding textures of shade."""

@final
class Block:
    """The result of a job: encoded tiles and the seam."""
    @property
    def tiles(self) -> list[tuple[int, int, int, int, bytes]]:
        """(layer number, z, x, y, encoded bytes); tiles without content are not listed."""
    @property
    def seam(self) -> bytes | None:
        """None: the block has no content."""
    @property
    def stats(self) -> dict[str, float]:
        """Seconds of processor time by stage, and counts."""

def reduce_block(frame: Frame, z: int, x: int, y: int, levels: int, seams: list[tuple[int, int, bytes]]) -> Block:
    """Reduces the block rooted at (z, x, y), of `levels` levels. `seams`: (x, y, bytes) of blocks rooted at level z + levels."""

def check_seam(frame: Frame, seam: bytes) -> None:
    """Raises FormatError unless the bytes are a whole seam of a block of this frame's pass (spec/pyramid.md §8)."""

# -- images, for tests and tools ------------------------------------------------------------------------------------------------------

def encode_layer(kind: str, format: _Format, array: NDArray[Any], quality: int = 80, small: bool = False) -> bytes:
    """Encodes one layer of a G-buffer as an image; `small` trades time for fewer bytes."""

def encode_png(kind: str, pixels: NDArray[np.uint8], order: Sequence[int], small: bool = False) -> bytes:
    """Encodes channels of (H, W, C) bytes, in the given order, as an 8-bit PNG of 1 to 4 channels, with the filter and the compression of a kind of layer."""

def encode_bits(bits: NDArray[np.bool_]) -> bytes:
    """Encodes (H, W) as a PNG of one bit per pixel: True is white."""

def decode_png(data: bytes) -> NDArray[np.uint8]:
    """Decodes an 8-bit PNG into (H, W, C)."""

def decode_image(data: bytes) -> NDArray[np.uint8]:
    """Decodes the image of a texture, in any format that is read, into (H, W, 4), sRGB with straight alpha. Raises FormatError for a cut or damaged one."""

def encode_data_tile(normal: NDArray[np.int16], id: NDArray[np.uint32], depth: NDArray[np.uint32], small: bool = False) -> bytes:
    """Encodes normal (H, W, 3), id and depth (H, W) of a G-buffer as one data tile (spec/data-tile.md); `small` trades time for fewer bytes."""

def decode_data_tile(data: bytes) -> dict[str, NDArray[Any]]:
    """Decodes a data tile into normal (H, W, 3) uint8, id and depth (H, W) uint32. Raises FormatError for everything that readers refuse."""

def texture_level(path: str, level: int) -> NDArray[np.uint8]:
    """Decodes a level of a .m3t file into (H, W, 4), sRGB with straight alpha, unused texels filled."""
