"""Peers beside us in the same run, in turns, on the same ground: pictures of one tile, and of 4, 16 and 64 neighbouring tiles at once."""

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

from .crew import Crew, Place
from .peers import Frame, Missing, wider
from .peers.cycles import Cycles
from .peers.mitsuba import Mitsuba
from .peers.opengl import OpenGL
from .peers.ours import Ours

PICTURES = (16, 6, 2, 1)
"""How many pictures are drawn of 1, 2, 4 and 8 tiles on a side."""
ROUNDS = (3, 3, 2, 2)
SOFTWARE = {"EGL_PLATFORM": "surfaceless", "LIBGL_ALWAYS_SOFTWARE": "1"}
AGREE_M = 0.02
COLORS = ("webp", "jpeg")


@dataclass(frozen=True)
class Row:
    """`tiles` with content on the pictures; tiles a second at the best of the rounds. Of ours by format of the colour layer: tiles a second, and the
    median over the rounds of ours over the peer's."""

    peer: str
    px: int
    pictures: int
    tiles: int
    tiles_per_s: float
    ours_per_s: dict[str, float]
    ratio: dict[str, float]


@dataclass(frozen=True)
class Agreement:
    """Shares of a tile's pixels whose id differs, and whose depth differs by more than 2 cm, from ours."""

    peer: str
    tile: Place
    id: float
    depth: float


def measure(folder: Path, parsed: Frame, tiles: list[Place], shown: Place, pictures: Path | None = None) -> dict[str, Any]:
    """`tiles`: all base tiles with content; the tables are printed. `shown`: the tile that is compared; `pictures`: folder for pictures of it."""
    with ExitStack() as stack:
        cores = len(os.sched_getaffinity(0))
        ours = stack.enter_context(Crew("map3d", partial(Ours, folder), cores))
        peers = list(_peers(stack, folder, cores))
        agreements = [_agreement(ours, peer, parsed, shown, pictures) for peer in peers]
        rows = []
        for doublings, (count, rounds) in enumerate(zip(PICTURES, ROUNDS, strict=True)):
            rows += _turns(ours, peers, parsed, tiles, doublings, count, rounds)
    _print(rows, agreements)
    return {"rows": [asdict(row) for row in rows], "agreement": [asdict(one) for one in agreements], **ratios(rows)}


def _peers(stack: ExitStack, folder: Path, cores: int) -> Iterator[Crew]:
    """Those that can be had; the others are named aloud."""
    kinds: list[tuple[str, Callable[[], Any], int, dict[str, str]]] = [
        ("Mitsuba 3", partial(Mitsuba, folder), 1, {}),
        (f"OpenGL, {cores} threads", partial(OpenGL, folder), 1, {**SOFTWARE, "LP_NUM_THREADS": str(cores)}),
        (f"OpenGL, {cores} processes", partial(OpenGL, folder), cores, {**SOFTWARE, "LP_NUM_THREADS": "1"}),
        ("Blender Cycles", partial(Cycles, folder), 1, {}),
    ]
    for name, make, processes, environment in kinds:
        try:
            yield stack.enter_context(Crew(name, make, processes, environment))
        except Missing as missing:
            Console(stderr=True).print(f"[bold]peer skipped: {missing}[/]")


def _turns(ours: Crew, peers: list[Crew], frame: Frame, tiles: list[Place], doublings: int, count: int, rounds: int) -> list[Row]:
    """All draw the same ground `rounds` times in turns; ours tile by tile."""
    squares = fullest(tiles, doublings, count)
    own = [tile for tile in tiles if (tile[0] >> doublings, tile[1] >> doublings) in set(squares)]
    works: list[Callable[[], float]] = [partial(ours.seconds, colored(frame, color), own) for color in COLORS]
    works += [partial(peer.seconds, wider(frame, doublings), squares) for peer in peers]
    for work in works:
        work()
    times = np.array([[work() for work in works] for _ in range(rounds)])
    rates = (len(own) / times.min(0)).tolist()
    rows = []
    for number, peer in enumerate(peers, len(COLORS)):
        ratio = {color: statistics.median(times[:, number] / times[:, k]) for k, color in enumerate(COLORS)}
        ours_per_s = dict(zip(COLORS, rates, strict=False))
        rows.append(Row(peer.name, frame["tile_px"] << doublings, len(squares), len(own), rates[number], ours_per_s, ratio))
    return rows


def colored(frame: Frame, color: str) -> Frame:
    """The frame with its colour layer in another format."""
    return {**frame, "layers": [{**layer, "format": color} if layer["kind"] == "color" else layer for layer in frame["layers"]]}


def fullest(tiles: list[Place], doublings: int, count: int) -> list[Place]:
    """The squares of 2^doublings tiles with the most content; of single tiles, evenly chosen ones."""
    places, filled = np.unique(np.array(tiles) >> doublings, axis=0, return_counts=True)
    order = np.argsort(-filled, kind="stable") if doublings else np.arange(len(places))[:: max(1, len(places) // count)]
    return [(int(x), int(y)) for x, y in places[order[:count]]]


def ratios(rows: list[Row]) -> dict[str, dict[str, float]]:
    """Ours over the quickest peer at one tile a picture, and over the quickest at whatever size suits it best; by format of the colour layer."""
    if not rows:
        return {}
    single = [row for row in rows if row.px == min(other.px for other in rows)]
    return {
        "over the best peer at one tile a picture": {color: min(row.ratio[color] for row in single) for color in COLORS},
        "over the best peer at its best size": {color: min(row.ratio[color] for row in rows) for color in COLORS},
    }


def _agreement(ours: Crew, peer: Crew, frame: Frame, tile: Place, pictures: Path | None) -> Agreement:
    names, depths = ours.ask("centres", frame, *tile)
    their_names, their_depths = peer.ask("centres", frame, *tile)
    hit, their_hit = np.isfinite(depths), np.isfinite(their_depths)
    off = np.abs(np.where(hit, depths, 0) - np.where(their_hit, their_depths, 0)) > AGREE_M
    if pictures is not None:
        _keep(pictures, {crew.name: crew.ask("picture", frame, *tile) for crew in (ours, peer)})
    return Agreement(peer.name, tile, float((names != their_names).mean()), float(off.mean()))


def _keep(folder: Path, drawn: dict[str, Any]) -> None:
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    for name, pixels in drawn.items():
        Image.fromarray(pixels).save(folder / f"{name.replace(' ', '_')}.png")


def _print(rows: list[Row], agreements: list[Agreement]) -> None:
    table = Table(title="tiles a second on all cores, 16 samples: peers without encoding, ours encoded", title_justify="left")
    ours = [head for color in COLORS for head in (f"ours, {color}", "ratio")]
    for column in ("peer", "px", "pictures", "tiles", "peer", *ours):
        table.add_column(column, justify="left" if column == "peer" and not table.columns else "right")
    for row in rows:
        beside = [text for color in COLORS for text in (f"{row.ours_per_s[color]:.1f}", f"{row.ratio[color]:.1f} ×")]
        table.add_row(row.peer, str(row.px), str(row.pictures), str(row.tiles), f"{row.tiles_per_s:.1f}", *beside)
    console = Console(width=140)
    console.print(table)
    for one in agreements:
        console.print(
            f"{one.peer}: of tile {one.tile} {100 * one.id:.3f} % of the ids differ from ours, {100 * one.depth:.3f} % of the depths by 2 cm"
        )
    for what, found in ratios(rows).items():
        console.print(f"{what}: " + ", ".join(f"{color} {ratio:.1f} ×" for color, ratio in found.items()))
