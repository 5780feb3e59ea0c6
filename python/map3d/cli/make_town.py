"""map3d make-town."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from map3d.cli.options import cores, json_option
from map3d.cli.output import print_json, size_text
from map3d.cli.progress import progress_bar


@click.command("make-town")
@click.option("-o", "--out", type=click.Path(path_type=Path), required=True, help="Folder to write into; a town begun there is completed.")
@click.option("--style", type=click.Choice(["town", "roman"]), default="town", show_default=True)
@click.option("--buildings", type=click.IntRange(1), default=300, show_default=True)
@click.option("--seed", type=int, default=1, show_default=True, help="Another seed, another town; the same seed, the same bytes.")
@click.option("--files", type=click.IntRange(1), default=1, show_default=True, help="Over how many CityGML files.")
@click.option("--texture-px", type=int, help="Side of a texture atlas.  [default: 1024; 512 below 100 buildings]")
@click.option("--textures", type=click.IntRange(1), help="How many atlases in all.  [default: one for two buildings]")
@click.option("--ortho-px", type=click.IntRange(1), help="Least side of the orthophoto in pixels.  [default: by size]")
@click.option("--formats", default="citygml", show_default=True, help="citygml, obj, or both with a comma.")
@click.option("--terrain/--no-terrain", default=True, show_default=True)
@click.option("--trees/--no-trees", default=True, show_default=True)
@click.option("--crs", default="EPSG:25832", show_default=True)
@click.option("--workers", type=click.IntRange(1), default=cores, show_default="one for each core")
@click.option("--estimate", is_flag=True, help="Only say what the town will take on the disk, to about 15 %; nothing is written.")
@json_option
def command(out: Path, formats: str, workers: int, estimate: bool, as_json: bool, **spec: Any) -> None:
    """Make a town to try map3d with: textured buildings, terrain, trees, of any size.

    What is complete stays when it is interrupted; the same command again makes the rest.
    """
    from map3d_town import TownSpec, estimate_town, make_town

    town = TownSpec(formats=tuple(part.strip() for part in formats.split(",")), **spec)
    if estimate:
        need = estimate_town(town)
        text = f"about {size_text(need.disk_bytes)}: {need.textures:,} textures, orthophoto {need.ortho_side_px:,} px across"
        print_json(asdict(need)) if as_json else click.echo(text)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with progress_bar(*columns) as bar:
        task = bar.add_task("making a town", total=None)
        report = make_town(out, town, lambda what, done, total: bar.update(task, description=what, completed=done, total=total), workers)
    if as_json:
        print_json(asdict(report))
    else:
        click.echo(f"{report.buildings:,} buildings, {report.trees:,} trees, {report.textures:,} textures, {size_text(report.disk_bytes)} in {out}")
        click.echo(f"next: map3d site {out} -o SITE")
