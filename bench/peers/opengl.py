"""OpenGL on the CPU (Mesa's llvmpipe) through moderngl and EGL.

All indexed triangles are in one buffer, sorted by material and cell; visible cells are drawn from front to back. Textures have mipmaps, are
filtered trilinearly with 8 × anisotropy, and averaged in linear light. Colour has 16 samples per pixel: 2 × 2 pixels of four samples, which is
faster than 4 × 4 pixels. A separate pass draws normal, id and depth at pixel centres.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import FrameFields, PeerMissing
from .scene_parts import MaterialPart, TileSquare, depth_range, linear_from_srgb, read_parts, tile_square

try:
    import moderngl
except ImportError as error:
    moderngl = None
    REASON = str(error)

CELL_M = 64.0
FINER = 2
"""Pixels of the colour pass per side of a pixel, with four samples each."""
SRGB8, SRGB8_ALPHA8, FRAMEBUFFER_SRGB = 0x8C41, 0x8C43, 0x8DB9
MIX = np.array([0x9E3779B97F4A7C15 * (2 * k + 1) ** 9 % 2**64 | 1 for k in range(6)], np.uint64)
"""Odd factors that hash the six words of a vertex."""
VERTEX = np.dtype([("position", "<f4", 3), ("uv", "<f4", 2), ("id", "<u4")])

PLACE = """#version 330
uniform mat4 clip_from_local;
in vec3 position; in vec2 uv; in uint id;
out vec3 at; out vec2 st; flat out uint name;
void main() { at = position; st = uv; name = id; gl_Position = clip_from_local * vec4(position, 1.0); }"""
COLOR = """#version 330
uniform sampler2D image; uniform vec3 diffuse;
in vec2 st; out vec4 color;
void main() { color = vec4(texture(image, st).rgb * diffuse, 1.0); }"""
SURFACE = """#version 330
uniform vec3 forward;
in vec3 at; flat in uint name;
layout(location = 0) out vec4 normal; layout(location = 1) out uint id;
void main() {
  vec3 n = normalize(cross(dFdx(at), dFdy(at)));
  normal = vec4(0.5 + 0.5 * (dot(n, forward) > 0.0 ? -n : n), 1.0); id = name;
}"""
COVER = """#version 330
in vec2 position; void main() { gl_Position = vec4(position, 0.0, 1.0); }"""
SHRINK = """#version 330
uniform sampler2D fine; uniform int finer; out vec4 color;
void main() {
  ivec2 first = ivec2(gl_FragCoord.xy) * finer; color = vec4(0.0);
  for (int y = 0; y < finer; y++) for (int x = 0; x < finer; x++) color += texelFetch(fine, first + ivec2(x, y), 0);
  color /= float(finer * finer);
}"""


@dataclass(frozen=True)
class DrawRanges:
    """Ranges of triangles of one cell and material: boxes lo, hi (n, 3); first and number of corners (n,); material (n,)."""

    lo: NDArray[np.float64]
    hi: NDArray[np.float64]
    first: NDArray[np.int64]
    count: NDArray[np.int64]
    material: NDArray[np.int64]

    def visible(self, at: TileSquare) -> NDArray[np.int64]:
        """Returns the ranges that the tile may show, from front to back."""
        centre, half = (self.lo + self.hi) / 2, (self.hi - self.lo) / 2
        inside = np.ones(len(self.first), bool)
        for axis, middle in ((at.axes.right, at.u_m), (at.axes.up, at.v_m)):
            inside &= np.abs(centre @ axis - middle) <= half @ np.abs(axis) + at.side_m / 2
        chosen = np.flatnonzero(inside)
        nearest = centre @ at.axes.forward - half @ np.abs(at.axes.forward)
        return chosen[np.argsort(nearest[chosen], kind="stable")]


class OpenGL:
    def __init__(self, folder: Path) -> None:
        if moderngl is None:
            raise PeerMissing(f"OpenGL ({REASON}); pip install -r requirements/peers.lock")
        try:
            self._gl = moderngl.create_context(standalone=True, backend="egl")
        except Exception as error:
            raise PeerMissing(f"OpenGL ({error}); apt install libegl1 libgl1-mesa-dri") from error
        self.device = str(self._gl.info["GL_RENDERER"])
        if "llvmpipe" not in self.device:
            raise PeerMissing(f"OpenGL (the device is {self.device}, not llvmpipe); set LIBGL_ALWAYS_SOFTWARE=1")
        self._gl.enable(moderngl.DEPTH_TEST)
        self._gl.enable_direct(FRAMEBUFFER_SRGB)
        self._materials: list[tuple[Any, tuple[float, ...]]] = []
        self._load(folder)
        self._targets: dict[int, _Targets] = {}

    def _load(self, folder: Path) -> None:
        vertices, indices, batches, at = [], [], [], 0
        corner = 0
        for part in read_parts(folder):
            for chosen in _cells(part):
                own, order = _indexed(part, chosen)
                vertices.append(own)
                indices.append(order + at)
                box = own["position"].min(0), own["position"].max(0)
                batches.append((*box, corner, len(order), len(self._materials)))
                at, corner = at + len(own), corner + len(order)
            self._materials.append(self._load_material(part))
        columns = [np.array(column) for column in zip(*batches, strict=True)]
        self._batches = DrawRanges(columns[0].astype(float), columns[1].astype(float), *columns[2:])
        buffer, index = self._gl.buffer(np.concatenate(vertices).tobytes()), self._gl.buffer(np.concatenate(indices).astype("<u4").tobytes())
        self._color = self._gl.program(vertex_shader=PLACE, fragment_shader=COLOR)
        self._surface = self._gl.program(vertex_shader=PLACE, fragment_shader=SURFACE)
        shrink = self._gl.program(vertex_shader=COVER, fragment_shader=SHRINK)
        shrink["finer"] = FINER
        self._colored = self._gl.vertex_array(self._color, [(buffer, "3f 2f 4x", "position", "uv")], index)
        self._surfaces = self._gl.vertex_array(self._surface, [(buffer, "3f 8x u", "position", "id")], index)
        corners = self._gl.buffer(np.array([-1, -1, 3, -1, -1, 3], "<f4").tobytes())
        self._shrinking = self._gl.vertex_array(shrink, [(corners, "2f", "position")])
        self._lo, self._hi = self._batches.lo.min(0), self._batches.hi.max(0)

    def _load_material(self, part: MaterialPart) -> tuple[Any, tuple[float, ...]]:
        image = np.full((1, 1, 3), 255, np.uint8) if part.image is None else part.image
        texture = self._gl.texture(image.shape[1::-1], 3, np.ascontiguousarray(image[::-1]).tobytes(), alignment=1, internal_format=SRGB8)
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        texture.anisotropy = 8.0
        texture.repeat_x = texture.repeat_y = part.repeats
        diffuse = (1.0, 1.0, 1.0) if part.image is not None else tuple(linear_from_srgb(np.array(part.diffuse)).tolist())
        return texture, diffuse

    def draw(self, frame: FrameFields, x: int, y: int) -> dict[str, NDArray[Any]]:
        """Returns color (H, W, 4) uint8 sRGB, normal (H, W, 4) uint8, id (H, W) uint32, depth (H, W) float32 of the depth buffer."""
        at = tile_square(frame, x, y)
        near, far = depth_range(self._lo, self._hi, at.axes)
        matrix = _clip_from_local(at, near, far).T.astype("<f4").tobytes()
        visible = self._batches.visible(at)
        if at.px not in self._targets:
            self._targets[at.px] = _Targets(self._gl, at.px)
        target = self._targets[at.px]
        self._draw_surfaces(target, matrix, at, visible)
        self._draw_colors(target, matrix, visible)
        shape = (at.px, at.px)
        return {
            "color": np.frombuffer(target.color.read(), np.uint8).reshape(*shape, 4)[::-1],
            "normal": np.frombuffer(target.normal.read(), np.uint8).reshape(*shape, 4)[::-1],
            "id": np.frombuffer(target.id.read(), np.uint32).reshape(shape)[::-1],
            "depth": np.frombuffer(target.depth.read(), np.float32).reshape(shape)[::-1],
        }

    def _draw_surfaces(self, target: "_Targets", matrix: bytes, at: TileSquare, visible: NDArray[np.int64]) -> None:
        """Draws normal, id and depth with one sample per pixel."""
        target.surfaces.use()
        target.surfaces.clear(depth=1.0)
        self._surface["clip_from_local"].write(matrix)
        self._surface["forward"].value = at.axes.forward
        for batch in visible:
            self._surfaces.render(vertices=int(self._batches.count[batch]), first=int(self._batches.first[batch]))

    def _draw_colors(self, target: "_Targets", matrix: bytes, visible: NDArray[np.int64]) -> None:
        target.samples.use()
        target.samples.clear(depth=1.0)
        self._color["clip_from_local"].write(matrix)
        for batch in visible:
            texture, diffuse = self._materials[self._batches.material[batch]]
            texture.use(0)
            self._color["diffuse"].value = diffuse
            self._colored.render(vertices=int(self._batches.count[batch]), first=int(self._batches.first[batch]))
        self._gl.copy_framebuffer(target.fine, target.samples)
        target.colors.use()
        target.fine_texture.use(0)
        self._gl.disable(moderngl.DEPTH_TEST)
        self._shrinking.render(vertices=3)
        self._gl.enable(moderngl.DEPTH_TEST)

    def centres(self, frame: FrameFields, x: int, y: int) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
        layers = self.draw(frame, x, y)
        near, far = depth_range(self._lo, self._hi, tile_square(frame, x, y).axes)
        depth = near + layers["depth"].astype(float) * (far - near) - frame["d0_m"]
        return layers["id"].copy(), np.where(layers["id"] > 0, depth, np.inf)

    def picture(self, frame: FrameFields, x: int, y: int) -> NDArray[np.uint8]:
        return self.draw(frame, x, y)["color"][..., :3].copy()


class _Targets:
    """The framebuffers of images of `px` pixels."""

    def __init__(self, gl: Any, px: int) -> None:
        fine = (px * FINER, px * FINER)
        self.normal, self.id = gl.texture((px, px), 4), gl.texture((px, px), 1, dtype="u4")
        self.depth = gl.depth_texture((px, px))
        self.surfaces = gl.framebuffer([self.normal, self.id], self.depth)
        colors = gl.texture(fine, 4, samples=4, internal_format=SRGB8_ALPHA8)
        self.samples = gl.framebuffer([colors], gl.depth_renderbuffer(fine, samples=4))
        self.fine_texture = gl.texture(fine, 4, internal_format=SRGB8_ALPHA8)
        self.fine = gl.framebuffer([self.fine_texture])
        self.color = gl.texture((px, px), 4, internal_format=SRGB8_ALPHA8)
        self.colors = gl.framebuffer([self.color])


def _cells(part: MaterialPart) -> list[NDArray[np.int64]]:
    """Returns the numbers of the part's triangles by cell."""
    keys = np.floor(part.corners[..., :2].mean(1) / CELL_M).astype(np.int64)
    order = np.lexsort((keys[:, 0], keys[:, 1]))
    cuts = np.flatnonzero(np.any(np.diff(keys[order], axis=0) != 0, axis=1)) + 1
    return np.split(order, cuts)


def _indexed(part: MaterialPart, chosen: NDArray[np.int64]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Returns the distinct vertices, and three indices per triangle."""
    corners = np.zeros((len(chosen), 3), VERTEX)
    corners["position"], corners["uv"], corners["id"] = part.corners[chosen], part.uvs[chosen], part.ids[chosen][:, None]
    words = corners.ravel().view("<u4").reshape(-1, VERTEX.itemsize // 4).astype(np.uint64)
    mixed = (words * MIX).sum(1, dtype=np.uint64)
    _, first, order = np.unique(mixed, return_index=True, return_inverse=True)
    assert np.array_equal(words[first][order], words), "hash collision of two vertices"
    return corners.ravel()[first], order.ravel()


def _clip_from_local(at: TileSquare, near: float, far: float) -> NDArray[np.float64]:
    matrix, half = np.eye(4), at.side_m / 2
    matrix[0, :3], matrix[0, 3] = np.array(at.axes.right) / half, -at.u_m / half
    matrix[1, :3], matrix[1, 3] = np.array(at.axes.up) / half, -at.v_m / half
    matrix[2, :3], matrix[2, 3] = 2 * np.array(at.axes.forward) / (far - near), -(far + near) / (far - near)
    return matrix
