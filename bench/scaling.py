"""Computes what a country costs, from measured figures: `python -m bench.scaling`; docs/scaling.md explains the model."""

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from math import radians, sin
from typing import Any

BLOCK_TILES = 64
"""Base tiles of a base block."""
BLOCKS_PER_BASE_BLOCK = 64 / 63
"""Base and reduce blocks together, per base block."""
HOUR_S = 3600.0
CORES = 1000


@dataclass(frozen=True)
class Country:
    """`area_km2`: that has content; `res_m`: of the deepest level; `orthophoto_bytes`: compressed."""

    buildings: float = 10e6
    area_km2: float = 357_000.0
    orthophoto_bytes: float = 50e12
    directions: int = 8
    pitch_deg: float = 45.0
    res_m: float = 0.2
    tile_px: int = 256

    @property
    def base_tiles(self) -> float:
        """Tiles of all directions. The ground is foreshortened by the sine of the pitch; what stands on it hides as much ground as it covers."""
        tile_m2 = (self.tile_px * self.res_m) ** 2
        return self.directions * self.area_km2 * 1e6 * sin(radians(self.pitch_deg)) / tile_m2

    @property
    def blocks(self) -> float:
        return self.base_tiles / BLOCK_TILES * BLOCKS_PER_BASE_BLOCK


@dataclass(frozen=True)
class Measured:
    """Figures of docs/benchmarks.md, mostly of its city of the Rotterdam class (60,000 buildings, 65,536 base tiles), and of `bench planning`.

    The city's import does not separate its orthophoto from its buildings. The model charges all of it to each of them, so it is an upper bound.
    """

    import_s_per_building: float = 12.7 * 60 / 60_000
    import_s_per_orthophoto_byte: float = 12.7 * 60 / 1.03e9
    build_s_per_building: float = 21.0 * 60 / 60_000
    texture_s_per_orthophoto_byte: float = 0.022 * 65_536**2 / 1024**2 / 1.03e9
    """Preparation of textures of 1024² in 22 ms each."""
    render_s_per_base_tile: float = 40.8 * 60 / 65_536
    publish_s_per_base_tile: float = 1.9 * 60 / 65_536
    plan_s_per_block: float = 5e-6
    catalogue_s_per_block: float = 25e-6
    """Adding a job to the SQLite catalogue."""
    scene_bytes_per_building: float = 12.4e9 / 60_000
    tile_bytes_per_base_tile: float = 4.75e9 / 65_536
    """Total of four layers on all levels."""
    puts_per_block: float = 1.0
    gets_per_block: float = 3.0
    """The block that it may replace; its seam for the block above, in two reads."""


@dataclass(frozen=True)
class Prices:
    """In US dollars: list prices of a large cloud in 2024. Look up today's."""

    cpu_hour: float = 0.04
    spot_cpu_hour: float = 0.015
    gigabyte_month: float = 0.023
    million_puts: float = 5.0
    million_gets: float = 0.4
    egress_gigabyte: float = 0.09


@dataclass(frozen=True)
class CostRow:
    what: str
    amount: str
    dollars: float


def cpu_seconds(country: Country, measured: Measured) -> dict[str, float]:
    """Returns step → CPU seconds."""
    return {
        "import of the buildings": country.buildings * measured.import_s_per_building,
        "import of the orthophoto": country.orthophoto_bytes * measured.import_s_per_orthophoto_byte,
        "build": country.buildings * measured.build_s_per_building + country.orthophoto_bytes * measured.texture_s_per_orthophoto_byte,
        "planning": country.blocks * (measured.plan_s_per_block + measured.catalogue_s_per_block),
        "render": country.base_tiles * measured.render_s_per_base_tile,
        "publish": country.base_tiles * measured.publish_s_per_base_tile,
    }


def costs(country: Country, measured: Measured, prices: Prices) -> list[CostRow]:
    """Returns the rows of the table in docs/scaling.md."""
    rows = [CostRow(f"{what}, CPU", _hours(s), s / HOUR_S * prices.cpu_hour) for what, s in cpu_seconds(country, measured).items()]
    puts, gets = country.blocks * measured.puts_per_block, country.blocks * measured.gets_per_block
    tiles, scene = country.base_tiles * measured.tile_bytes_per_base_tile, country.buildings * measured.scene_bytes_per_building
    return [
        *rows,
        CostRow("writing blocks to an object store", f"{puts / 1e6:,.1f} M PUT", puts / 1e6 * prices.million_puts),
        CostRow("reading blocks while rendering", f"{gets / 1e6:,.1f} M GET", gets / 1e6 * prices.million_gets),
        CostRow("tiles, per month", _size(tiles), tiles / 1e9 * prices.gigabyte_month),
        CostRow("built scene without orthophoto, per month", _size(scene), scene / 1e9 * prices.gigabyte_month),
        CostRow("orthophoto, per month", _size(country.orthophoto_bytes), country.orthophoto_bytes / 1e9 * prices.gigabyte_month),
    ]


def render_days(country: Country, measured: Measured, cores: int) -> float:
    """Returns the days that a render takes on many cores, which share nothing but stores and catalogue."""
    return cpu_seconds(country, measured)["render"] / cores / 86_400


def markdown(rows: Iterable[CostRow]) -> str:
    lines = ["| | amount | US $ |", "|---|---|---|", *(f"| {row.what} | {row.amount} | {row.dollars:,.0f} |" for row in rows)]
    return "\n".join(lines)


def _hours(seconds: float) -> str:
    return f"{seconds / HOUR_S:,.0f} h" if seconds >= 10 * HOUR_S else f"{seconds / HOUR_S:.1f} h"


def _size(size: float) -> str:
    return f"{size / 1e12:,.1f} TB"


def main(arguments: Sequence[str] | None = None) -> None:
    """Every field of the three records is an option."""
    parser = argparse.ArgumentParser(prog="bench.scaling", description="Computes what a country costs.")
    records: list[Any] = [Country, Measured, Prices]
    for record in records:
        for item in fields(record):
            parser.add_argument(f"--{item.name.replace('_', '-')}", type=type(item.default), default=item.default)
    given = vars(parser.parse_args(arguments))
    country, measured, prices = (record(**{item.name: given[item.name] for item in fields(record)}) for record in records)
    days = render_days(country, measured, CORES)
    print(f"{country.base_tiles / 1e6:,.0f} M base tiles, {country.blocks / 1e6:,.1f} M blocks")
    print(f"on {CORES:,} cores: {days:.2f} days, {country.blocks / days / 86_400:,.0f} jobs a second\n")
    print(markdown(costs(country, measured, prices)))


if __name__ == "__main__":
    main()
