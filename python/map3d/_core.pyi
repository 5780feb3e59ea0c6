"""The compiled core, `crates/map3d-py`: a thin skin over the Rust crates. The GIL is released in every long call.

Structured arguments and results travel as JSON text (serde on the other side); arrays as NumPy. Errors: `CoreError` and its leaves below.
"""

from collections.abc import Callable, Iterator
from typing import Any, Literal, final

import numpy as np
from numpy.typing import NDArray

__version__: str
RENDER_FORMAT: int
"""Raised only when rendered bytes change."""

class CoreError(Exception): ...

class FormatError(CoreError):
    """A file is not what it claims to be: truncated, wrong magic, checksum, unknown version, malformed."""

class LimitError(CoreError):
    """A limit of SAFETY was met; the message names it, its value and what was asked for."""

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
        """Replace them, e.g. reprojected. Same shape."""
    @property
    def prototype(self) -> bool:
        """True: the positions are in a prototype's own frame, not in the source's CRS."""
    @property
    def triangle_count(self) -> int: ...

@final
class Reader:
    """One source document, parsed as it is iterated. `format`: "obj" | "citygml".

    options (JSON): {"up": "y"|"z", "split": "file"|"group" (OBJ), "theme": str|null (CityGML appearance theme; null: the first in the file),
    "lod": str|null (null: best per object), "strict": bool, "max_image_side_px": 16384, ...limits of SAFETY}
    """
    def __init__(self, path: str, format: str, options: str = "{}") -> None: ...
    @property
    def srs_name(self) -> str | None:
        """As the source writes it; known before the first batch when the source has it at its head, else after the last."""
    def __iter__(self) -> Iterator[Batch]: ...
    def __next__(self) -> Batch: ...
    def instances(self) -> NDArray[np.float64]:
        """(m, 12) transforms of the instances (prototype → source CRS), after the last batch."""
    def set_instances(self, transforms: NDArray[np.float64]) -> None: ...
    def report(self) -> str:
        """report.json so far (spec/scene.md)."""

@final
class AssetWriter:
    """Writes an asset folder (spec/scene.md): mesh.m3a, materials.json, objects.jsonl, textures/, report.json."""
    def __init__(self, folder: str) -> None: ...
    def append(self, batch: Batch) -> None: ...
    def append_mesh(
        self, positions: NDArray[np.float64], triangles: NDArray[np.uint32], uvs: NDArray[np.float32] | None, material: int, object: int, rank: int
    ) -> None:
        """For assets made in Python (terrain): (n,3) world, (t,3), (t,3,2)."""
    def set_tables(self, materials: str, objects: str) -> None:
        """For assets made in Python: materials.json and objects as a JSON list; textures are put into textures/ by the caller."""
    def finish(self, reader: Reader | None) -> str:
        """Closes the files, returns report.json."""

# -- build: assets → chunks and textures (map3d-scene, map3d-image) ---------------------------------------------------------------

Progress = Callable[[str, int, int], bool]
"""(stage, done, total) → False to stop; then `Interrupted` is raised and what is finished stays."""

class Interrupted(CoreError): ...

def build_scene(folder: str, request: str, progress: Progress | None = None) -> str:
    """Builds chunks/, textures/, instances.m3i and scene.json of a scene folder from its assets; returns the report (JSON). Unchanged chunks and textures are kept.

    request: {"assets": ["name", …], "origin": [x,y,z], "options": {"merge_vertices": true, "merge_faces": true, "drop_degenerate": true,
    "merge_materials": true, "drop_untextured": false, "ground_plane": "auto"|"on"|"off"}, "ground_id": u32, "threads": n, "max_memory_bytes": n}
    """

# -- tracing and blocks (map3d-trace, map3d-render) --------------------------------------------------------------------------------

@final
class Scene:
    """A built scene, opened for tracing: chunks are memory-mapped as they are needed, textures cached up to `cache_bytes`. Safe to share between threads."""
    def __init__(self, folder: str, cache_bytes: int = 512 << 20) -> None: ...
    @property
    def origin(self) -> tuple[float, float, float]: ...
    @property
    def box(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Local box of all content."""
    @property
    def triangle_count(self) -> int:
        """Instances not counted."""
    def occupied(self, frame: str, level: int, within: tuple[int, NDArray[np.uint32]] | None = None) -> NDArray[np.bool_]:
        """(2^level, 2^level) [y, x]: conservative, from the boxes of BVH nodes. `within`: a level above and (n, 2) columns and rows of its blocks;
        only they are looked at, outside of them all is False."""
    def block_key(self, frame: str, z: int, x: int, y: int) -> str:
        """Hex hash over all that a base block's bytes depend on."""
    def block_keys(self, frame: str, z: int, blocks: NDArray[np.uint32]) -> list[str]:
        """The keys of the blocks of level z at (n, 2) columns and rows, each chunk looked at once."""
    def render_block(self, frame: str, z: int, x: int, y: int) -> Block:
        """A base block rooted at (z, x, y)."""
    def gbuffer(self, frame: str, x: int, y: int) -> dict[str, NDArray[Any]]:
        """One base tile's G-buffer (spec/pyramid.md §5): id, depth and the arrays of the frame's layers; color, normal, id, depth without any."""
    def pick(self, frame: str, u: float, v: float) -> tuple[int, float, tuple[float, float, float]] | None:
        """(id, D, local position) of the surface that a single ray at view coordinates (U, V) meets first."""
    def occluded(self, origins: NDArray[np.float64], direction: tuple[float, float, float], max_distance: float) -> NDArray[np.bool_]:
        """Any-hit rays from local positions (n, 3)."""
    def stats(self) -> dict[str, int]:
        """Cache hits, misses, bytes; chunks mapped; triangles tested; ..."""

# frame (JSON): {"look_at_deg", "pitch_deg", "u0_m", "v0_m", "d0_m", "size_m", "tile_px", "zmax", "layers": [{"kind","format","quality"?}]}

@final
class Block:
    """What a job yields: encoded tiles and the seam."""
    @property
    def tiles(self) -> list[tuple[int, int, int, int, bytes]]:
        """(layer number, z, x, y, encoded bytes); tiles without content are not listed."""
    @property
    def seam(self) -> bytes | None:
        """None: the block has no content."""
    @property
    def stats(self) -> dict[str, float]:
        """Seconds of visibility, shade, reduce, encode; traced tiles; ..."""

def reduce_block(frame: str, z: int, x: int, y: int, levels: int, seams: list[tuple[int, int, bytes]]) -> Block:
    """A reduce block of root (z, x, y) with `levels` levels; seams: (x, y, bytes) of blocks rooted at level z + levels."""

def encode_layer(
    kind: Literal["color", "normal", "id", "depth", "sun", "sun16", "ao", "depth2", "picture"],
    format: str,
    array: NDArray[Any],
    quality: int = 80,
    small: bool = False,
) -> bytes:
    """One layer of a G-buffer → image bytes; `small` spends time for fewer."""

def decode_png(data: bytes) -> NDArray[np.uint8]:
    """(H, W, C), for checks."""

def reduce_gbuffers(children: list[dict[str, NDArray[Any]] | None]) -> dict[str, NDArray[Any]]:
    """Parent of up to four children (spec/pyramid.md §7); for tests."""

# -- texture, for tests and tools ---------------------------------------------------------------------------------------------------

def texture_level(path: str, level: int) -> NDArray[np.uint8]:
    """(H, W, 4) of a .m3t, filled."""
