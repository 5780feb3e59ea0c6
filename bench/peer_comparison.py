"""Compares map3d with other renderers, in turns, on the same tiles: images of one tile, and of 4, 16 and 64 neighbouring tiles at once."""

import os
import statistics
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from .peers import FrameFields, PeerMissing, with_larger_tiles
from .peers.cycles import Cycles
from .peers.map3d_peer import Map3dRenderer
from .peers.mitsuba import Mitsuba
from .peers.opengl import OpenGL
from .renderer_pool import RendererPool, TilePosition

PICTURES = (16, 6, 2, 1)
"""Number of images of 1, 2, 4 and 8 tiles per side."""
ROUNDS = (3, 3, 2, 2)
SOFTWARE_GL = {"EGL_PLATFORM": "surfaceless", "LIBGL_ALWAYS_SOFTWARE": "1"}
AGREE_M = 0.02
COLORS = ("webp", "jpeg")
SINGLE, BEST = "over the best peer with one tile per image", "over the best peer at its best size"
GOALS = {SINGLE: 15.0, BEST: 5.0}
"""Least ratios that we aim at."""


@dataclass(frozen=True)
class PeerRow:
    """Tiles per second of a peer, best round. `px`: side of its images; `tiles`: tiles with content in them. `ours_per_s`: tiles per second of
    map3d by format of the colour layer; `ratio`: median over the rounds of map3d's rate over the peer's."""

    peer: str
    px: int
    pictures: int
    tiles: int
    tiles_per_s: float
    ours_per_s: dict[str, float]
    ratio: dict[str, float]


@dataclass(frozen=True)
class PeerAgreement:
    """Shares of a tile's pixels whose id differs from map3d's, and whose depth differs by more than 2 cm."""

    peer: str
    tile: TilePosition
    id: float
    depth: float


def measure(folder: Path, frame: FrameFields, tiles: list[TilePosition], shown: TilePosition, pictures: Path | None = None) -> dict[str, Any]:
    """Measures all peers and prints the tables.

    `tiles`: all base tiles with content; `shown`: the tile to compare; `pictures`: folder for images of it.
    """
    with ExitStack() as stack:
        cores = len(os.sched_getaffinity(0))
        ours = stack.enter_context(RendererPool("map3d", partial(Map3dRenderer, folder), cores))
        peers = list(_available_peers(stack, folder, cores))
        agreements = [_compare_with_peer(ours, peer, frame, shown, pictures) for peer in peers]
        rows = []
        for doublings, (count, rounds) in enumerate(zip(PICTURES, ROUNDS, strict=True)):
            rows += _measure_in_turns(ours, peers, frame, tiles, doublings, count, rounds)
    print_tables(rows, agreements)
    return {"rows": [asdict(row) for row in rows], "agreement": [asdict(agreement) for agreement in agreements], **best_ratios(rows)}


def _available_peers(stack: ExitStack, folder: Path, cores: int) -> Iterator[RendererPool]:
    """Yields the installed peers; prints the names of the others."""
    kinds: list[tuple[str, Callable[[], Any], int, dict[str, str]]] = [
        ("Mitsuba 3", partial(Mitsuba, folder), 1, {}),
        (f"OpenGL, {cores} threads", partial(OpenGL, folder), 1, {**SOFTWARE_GL, "LP_NUM_THREADS": str(cores)}),
        (f"OpenGL, {cores} processes", partial(OpenGL, folder), cores, {**SOFTWARE_GL, "LP_NUM_THREADS": "1"}),
        ("Blender Cycles", partial(Cycles, folder), 1, {}),
    ]
    for name, make, processes, environment in kinds:
        try:
            yield stack.enter_context(RendererPool(name, make, processes, environment))
        except PeerMissing as missing:
            Console(stderr=True).print(f"[bold]peer skipped: {missing}[/]")


def _measure_in_turns(
    ours: RendererPool, peers: list[RendererPool], frame: FrameFields, tiles: list[TilePosition], doublings: int, count: int, rounds: int
) -> list[PeerRow]:
    """All renderers draw the same area `rounds` times in turns; map3d draws single tiles."""
    squares = choose_squares(tiles, doublings, count)
    own = [tile for tile in tiles if (tile[0] >> doublings, tile[1] >> doublings) in set(squares)]
    tasks: list[Callable[[], float]] = [partial(ours.time_draws, with_color_format(frame, color), own) for color in COLORS]
    tasks += [partial(peer.time_draws, with_larger_tiles(frame, doublings), squares) for peer in peers]
    for task in tasks:
        task()
    times = np.array([[task() for task in tasks] for _ in range(rounds)])
    rates = (len(own) / times.min(0)).tolist()
    rows = []
    for number, peer in enumerate(peers, len(COLORS)):
        ratio = {color: statistics.median(times[:, number] / times[:, k]) for k, color in enumerate(COLORS)}
        ours_per_s = dict(zip(COLORS, rates, strict=False))
        rows.append(PeerRow(peer.name, frame["tile_px"] << doublings, len(squares), len(own), rates[number], ours_per_s, ratio))
    return rows


def with_color_format(frame: FrameFields, color: str) -> FrameFields:
    """Returns the frame with another format of the colour layer."""
    return {**frame, "layers": [{**layer, "format": color} if layer["kind"] == "color" else layer for layer in frame["layers"]]}


def choose_squares(tiles: list[TilePosition], doublings: int, count: int) -> list[TilePosition]:
    """Returns the squares of 2^doublings tiles per side with the most content, or evenly spaced single tiles."""
    places, filled = np.unique(np.array(tiles) >> doublings, axis=0, return_counts=True)
    order = np.argsort(-filled, kind="stable") if doublings else np.arange(len(places))[:: max(1, len(places) // count)]
    return [(int(x), int(y)) for x, y in places[order[:count]]]


def best_ratios(rows: list[PeerRow]) -> dict[str, dict[str, float]]:
    """Returns the rates over the fastest peer with one tile per image, and with the best size, by format of the colour layer."""
    if not rows:
        return {}
    single = [row for row in rows if row.px == min(other.px for other in rows)]
    return {
        SINGLE: {color: min(row.ratio[color] for row in single) for color in COLORS},
        BEST: {color: min(row.ratio[color] for row in rows) for color in COLORS},
    }


def _compare_with_peer(ours: RendererPool, peer: RendererPool, frame: FrameFields, tile: TilePosition, pictures: Path | None) -> PeerAgreement:
    names, depths = ours.call("centres", frame, *tile)
    their_names, their_depths = peer.call("centres", frame, *tile)
    hit, their_hit = np.isfinite(depths), np.isfinite(their_depths)
    off = np.abs(np.where(hit, depths, 0) - np.where(their_hit, their_depths, 0)) > AGREE_M
    if pictures is not None:
        _save_images(pictures, {pool.name: pool.call("picture", frame, *tile) for pool in (ours, peer)})
    return PeerAgreement(peer.name, tile, float((names != their_names).mean()), float(off.mean()))


def _save_images(folder: Path, drawn: dict[str, Any]) -> None:
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    for name, pixels in drawn.items():
        Image.fromarray(pixels).save(folder / f"{name.replace(' ', '_')}.png")


def print_tables(rows: list[PeerRow], agreements: list[PeerAgreement]) -> None:
    table = Table(title="tiles per second on all cores, 16 samples: peers without encoding, map3d with encoding", title_justify="left")
    ours = [head for color in COLORS for head in (f"ours, {color}", "ratio")]
    for column in ("peer", "px", "pictures", "tiles", "peer", *ours, "goal"):
        table.add_column(column, justify="left" if column == "peer" and not table.columns else "right")
    for row in rows:
        cells = [text for color in COLORS for text in (f"{row.ours_per_s[color]:.1f}", f"{row.ratio[color]:.1f} ×")]
        table.add_row(row.peer, str(row.px), str(row.pictures), str(row.tiles), f"{row.tiles_per_s:.1f}", *cells, f"{_goal_of(row, rows):g} ×")
    console = Console(width=140)
    console.print(table)
    for agreement in agreements:
        console.print(
            f"{agreement.peer}: tile {agreement.tile}: {100 * agreement.id:.3f} % of the ids differ from ours, "
            f"{100 * agreement.depth:.3f} % of the depths by more than 2 cm"
        )
    for what, found in best_ratios(rows).items():
        console.print(
            f"{what}: " + ", ".join(f"{color} {judged(ratio, GOALS[what])}" for color, ratio in found.items()) + f"; goal {GOALS[what]:g} ×"
        )


def _goal_of(row: PeerRow, rows: list[PeerRow]) -> float:
    return GOALS[SINGLE if row.px == min(other.px for other in rows) else BEST]


def judged(ratio: float, goal: float) -> str:
    """Returns a ratio, and whether it reaches its goal."""
    return f"{ratio:.1f} × ({'met' if ratio >= goal else 'missed'})"
