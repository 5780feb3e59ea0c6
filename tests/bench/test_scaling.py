"""The cost model: its laws, its number of tiles beside a real plan, and its table in docs/scaling.md."""

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from bench.scaling import Country, Measured, Prices, costs, cpu_seconds, main, markdown

from map3d.geometry.frames import pin
from map3d.renderings.plan import planned_occupancy
from map3d.types import ViewAngles
from tests.core.built import build_houses


def test_cost_of_rendering_is_proportional_to_the_picture() -> None:
    measured, country = Measured(), Country()
    base = cpu_seconds(country, measured)["render"]
    assert cpu_seconds(replace(country, directions=16), measured)["render"] == pytest.approx(2 * base)
    assert cpu_seconds(replace(country, res_m=country.res_m / 2), measured)["render"] == pytest.approx(4 * base)
    assert cpu_seconds(replace(country, area_km2=country.area_km2 / 2), measured)["render"] == pytest.approx(base / 2)
    assert cpu_seconds(replace(country, buildings=0.0), measured)["render"] == base


def test_a_city_of_the_measured_size_costs_what_was_measured() -> None:
    city = Country(buildings=60_000, orthophoto_bytes=0.0)
    spent = cpu_seconds(city, Measured())
    assert spent["import of the buildings"] == pytest.approx(12.7 * 60)
    assert spent["build"] == pytest.approx(21.0 * 60)
    assert spent["render"] / city.base_tiles * 65_536 == pytest.approx(40.8 * 60)


@pytest.mark.parametrize("pitch_deg", [30.0, 45.0, 90.0])
def test_number_of_base_tiles_is_that_of_a_plan(tmp_path: Path, pitch_deg: float) -> None:
    """A roof of 1 km² is planned; the tiles at its edges are the difference."""
    scene = build_houses(tmp_path, [(0.0, 0.0, 1000.0, 0.1)])
    (frame,) = pin(scene.box, 256, 0.05, (ViewAngles(0, pitch_deg),))
    planned = planned_occupancy(scene, frame).count(frame.zmax)
    expected = Country(area_km2=1.0, directions=1, pitch_deg=pitch_deg, res_m=frame.size_m / 2**frame.zmax / 256).base_tiles
    assert expected <= planned <= 1.1 * expected


def test_docs_show_the_table_of_the_defaults() -> None:
    text = (Path(__file__).parents[2] / "docs" / "scaling.md").read_text(encoding="utf-8")
    assert markdown(costs(Country(), Measured(), Prices())) in text, "run python -m bench.scaling and copy its table"


def test_every_figure_is_an_option(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--directions", "1", "--area-km2", "100", "--cpu-hour", "0", "--render-s-per-base-tile", "0.01"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("M base tiles, 0.0 M blocks")
    assert all(line.split("|")[3].strip() == "0" for line in lines if "CPU" in line)
