"""What `map3d site` prints between the build and the render: where the files are and how large, the resolution and why, and the cost."""

import click

from map3d.catalogue import Catalogue, Workspace
from map3d.cli.file_tables import print_files
from map3d.cli.output import plural, size_text, time_text
from map3d.renderings.cost_estimate import estimate
from map3d.scenes.file_contents import file_contents, union
from map3d.scenes.outlier_lines import extent_text, middle_of, outlier_lines
from map3d.scenes.outliers import read_outliers
from map3d.site.steps import SiteRendering

SAMPLE_S = 3.0


def print_extents(workspace: Workspace, catalogue: Catalogue, scene: str, *, was_built: bool) -> None:
    """Prints the files with what each holds, their extents and the place; repeats what an earlier build left out."""
    record = catalogue.scene(scene)
    files = file_contents(workspace, catalogue, scene)
    print_files(files)
    box = union([file.box for file in files])
    if box is not None:
        click.echo(f"the scene covers {extent_text(box)} around {middle_of(box, record.crs)}")
    if not was_built:
        for line in outlier_lines(read_outliers(workspace, scene), record.crs):
            click.echo(line, err=True)


def print_rendering(made: SiteRendering) -> None:
    record = made.record
    why = "" if made.resolution is None else f", since {made.resolution.why}; --res sets another"
    click.echo(
        f"rendering {record.name}: {plural(len(record.frames), 'view')}, {plural(record.zmax + 1, 'level')}, {record.res_m:g} m per pixel{why}"
    )
    if made.has_chosen_ao:
        click.echo("ambient occlusion is rendered, since textures cover less than a tenth of the surfaces; --no-ao leaves it out")
    if made.changes is None:
        return
    if made.changes.outgrown:
        click.echo("the content has outgrown the frames of the views, so that everything is rendered again")
    if made.changes.again:
        click.echo(f"everything is rendered again, since what is rendered does not fit {', '.join(made.changes.again)}")
    if made.changes.added:
        click.echo(f"added {', '.join(made.changes.added)}")


def print_estimate(workspace: Workspace, catalogue: Catalogue, rendering: str, workers: int) -> None:
    found = estimate(workspace, catalogue, rendering, workers, SAMPLE_S)
    if not found.open_tiles:
        return
    still = f"still to render: {plural(found.open_tiles, 'base tile')}, about {time_text(found.seconds)} with {plural(workers, 'worker')}"
    click.echo(f"about {plural(found.tiles, 'tile')} on all levels, {plural(found.images, 'image')}, {size_text(found.bytes)}; {still}")
