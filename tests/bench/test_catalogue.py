"""The jobs that the catalogue's benchmark plans, and its measures on a small SQLite catalogue."""

from pathlib import Path

import pytest

from bench import catalogue


@pytest.mark.parametrize("bases", [1, 64, 65, 5000])
def test_planned_jobs_are_a_pyramid_from_the_bottom(bases: int) -> None:
    seen = set()
    jobs = list(catalogue.planned_jobs(bases))
    for job in jobs:
        assert job.parent not in seen
        seen.add(job.block)
    assert {job.parent for job in jobs} - {None} == {job.block for job in jobs if job.kind == "reduce"}
    assert sum(job.kind == "base" for job in jobs) == bases
    assert [job.block.z for job in jobs if job.parent is None] == [0]


def test_measures_cover_all_jobs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "OVERHEAD_JOBS", 5)
    monkeypatch.setattr(catalogue, "LEASED_JOBS", 20)
    overhead = catalogue.measure_overhead("SQLite", f"sqlite://{tmp_path}/overhead.sqlite")
    assert overhead.total_ms == pytest.approx(overhead.lease_ms + overhead.heartbeat_ms + overhead.done_ms)
    assert catalogue.measure_rate("SQLite", f"sqlite://{tmp_path}/rate.sqlite", 2).jobs_per_s > 0
    assert catalogue.measure_plan("SQLite", f"sqlite://{tmp_path}/plan.sqlite", 100).jobs == len(list(catalogue.planned_jobs(100)))
