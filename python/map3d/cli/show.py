"""map3d show."""

from typing import Any

import click

from map3d.catalogue import Catalogue, State, Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import counts_text, plural, print_json, print_table
from map3d.errors import BadRequest
from map3d.geometry.views import view_id
from map3d.ingest.findings import findings, report_document
from map3d.types import Vec3

TOPICS = ("scenes", "scene", "renderings", "rendering", "report", "jobs", "quarantine")


@click.command("show")
@click.argument("topic", type=click.Choice(TOPICS), default="renderings")
@click.argument("name", required=False)
@json_option
@workspace_option
def command(workspace: Workspace, topic: str, name: str | None, as_json: bool) -> None:
    """Show scenes, renderings, import reports and jobs.

    \b
    scenes, renderings          list all of them (renderings is the default)
    scene NAME, rendering NAME  show one of them
    report SCENE                show what its imports skipped, and their warnings
    jobs RENDERING              count the blocks by state, and list the leased and quarantined ones
    quarantine RENDERING        list the blocks that failed three times, with reasons
    """
    if name is None and topic not in ("scenes", "renderings"):
        raise BadRequest(f"show {topic}: missing NAME; map3d show scenes and map3d show renderings list the names")
    with workspace.open_catalogue() as catalogue:
        _SHOW[topic](catalogue, name or "", as_json)


def _scenes(catalogue: Catalogue, _name: str, as_json: bool) -> None:
    scenes = catalogue.scenes()
    if as_json:
        print_json([{"scene": scene, "assets": [asset.name for asset in catalogue.assets(scene.name)]} for scene in scenes])
        return
    if not scenes:
        click.echo("no scenes yet; next: map3d create-scene NAME")
        return
    rows = [
        (scene.name, scene.crs.name if scene.crs else None, len(catalogue.assets(scene.name)), len(catalogue.renderings(scene.name)))
        for scene in scenes
    ]
    print_table(("scene", "coordinate system", "assets", "renderings"), rows)


def _scene(catalogue: Catalogue, name: str, as_json: bool) -> None:
    scene, assets = catalogue.scene(name), catalogue.assets(name)
    if as_json:
        print_json({"scene": scene, "assets": assets})
        return
    click.echo(f"{name}: {scene.crs.name if scene.crs else 'no coordinate system yet'}, {_origin_text(scene.origin)}")
    if (crs := scene.stated_crs) is not None:
        click.echo(f"heights: {crs.heights_text}")
    click.echo(f"options: {', '.join(map(_option_text, scene.options.items()))}")
    print_table(
        ("asset", "format", "objects", "triangles", "source"),
        [(asset.name, asset.format, asset.report.get("objects"), asset.report.get("triangles"), asset.source) for asset in assets],
    )


def _renderings(catalogue: Catalogue, _name: str, as_json: bool) -> None:
    renderings = catalogue.renderings()
    if as_json:
        print_json([{"rendering": item, "jobs": catalogue.count_jobs(item.name)} for item in renderings])
        return
    if not renderings:
        click.echo("no renderings yet; next: map3d create-rendering SCENE NAME --res METRES")
        return
    rows = [(item.name, item.scene, len(item.frames), item.zmax + 1, item.res_m, counts_text(catalogue.count_jobs(item.name))) for item in renderings]
    print_table(("rendering", "scene", "views", "levels", "m per pixel", "blocks"), rows)


def _rendering(catalogue: Catalogue, name: str, as_json: bool) -> None:
    item, counts = catalogue.rendering(name), catalogue.count_jobs(name)
    if as_json:
        print_json({"rendering": item, "jobs": counts})
        return
    click.echo(
        f"{name} of scene {item.scene}: {item.zmax + 1} levels, {item.res_m:g} m per pixel, "
        f"tiles of {item.tile_px} px, content version {item.content_version}"
    )
    click.echo(f"views: {', '.join(view_id(frame.angles) for frame in item.frames)}")
    for number, layers in enumerate(item.passes):
        names = ", ".join(f"{layer.name} ({layer.format})" for layer in layers)
        click.echo(f"layers: {names}" if number == 0 else f"added layers: {names}")
    click.echo(f"blocks: {counts_text(counts)}")


def _report(catalogue: Catalogue, name: str, as_json: bool) -> None:
    assets = catalogue.assets(name)
    if as_json:
        print_json({asset.name: report_document(asset.report) for asset in assets})
        return
    for asset in assets:
        report = asset.report
        click.echo(f"{asset.name} ({asset.format}): {plural(report.get('objects', 0), 'object')}, {plural(report.get('triangles', 0), 'triangle')}")
        rows = [(found.reason.severity, str(found.message), found.example) for found in findings(report)]
        if rows:
            print_table(("", "finding", "example"), rows)


def _jobs(catalogue: Catalogue, name: str, as_json: bool) -> None:
    jobs = list(catalogue.jobs(name))
    if as_json:
        catalogue.rendering(name)
        print_json(jobs)
        return
    click.echo(counts_text(catalogue.count_jobs(name)))
    open_jobs = [job for job in jobs if job.state not in (State.DONE, State.WAITING, State.TODO)]
    if open_jobs:
        print_table(
            ("track", "block", "kind", "state", "attempts", "expired", "worker", "reason"),
            [(job.track, job.block, job.kind, job.state, job.attempts, job.expiries, job.worker, job.reason) for job in open_jobs],
        )


def _quarantine(catalogue: Catalogue, name: str, as_json: bool) -> None:
    catalogue.rendering(name)
    jobs = list(catalogue.jobs(name, state=State.QUARANTINED))
    if as_json:
        print_json(jobs)
        return
    if not jobs:
        click.echo(f"{name} has no quarantined blocks")
        return
    print_table(("track", "block", "kind", "reason"), [(job.track, job.block, job.kind, job.reason) for job in jobs])
    click.echo(f"to try them again: map3d retry {name} && map3d render {name}")


def _origin_text(origin: Vec3 | None) -> str:
    return "no origin yet" if origin is None else f"origin {', '.join(f'{value:.15g}' for value in origin)}"


def _option_text(option: tuple[str, Any]) -> str:
    name, value = option
    return f"{name.replace('_', '-')} {value if not isinstance(value, bool) else 'on' if value else 'off'}"


_SHOW = {
    "scenes": _scenes,
    "scene": _scene,
    "renderings": _renderings,
    "rendering": _rendering,
    "report": _report,
    "jobs": _jobs,
    "quarantine": _quarantine,
}
