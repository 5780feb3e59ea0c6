"""map3d make-town and teatime: scenes for trying map3d."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from map3d.cli.options import json_option
from map3d.cli.output import print_json, size_text
from map3d.cli.progress import progress_bar
from map3d.cores import usable_cores


@click.command("make-town")
@click.option("-o", "--out", type=click.Path(path_type=Path), required=True, help="Output folder; an unfinished town in it is completed.")
@click.option("--style", type=click.Choice(["town", "roman"]), default="town", show_default=True, help="Style of streets and buildings.")
@click.option("--buildings", type=click.IntRange(1), default=300, show_default=True, help="Number of buildings.")
@click.option("--seed", type=int, default=1, show_default=True, help="Seed of the random generator; the same seed gives the same bytes.")
@click.option("--files", type=click.IntRange(1), default=1, show_default=True, help="Number of CityGML files.")
@click.option("--texture-px", type=int, help="Side of a texture atlas in pixels.  [default: 1024; 512 below 100 buildings]")
@click.option("--textures", type=click.IntRange(1), help="Number of texture atlases.  [default: one per two buildings]")
@click.option("--ortho-px", type=click.IntRange(1), help="Minimum side of the orthophoto in pixels.  [default: depends on the size of the town]")
@click.option("--formats", default="citygml", show_default=True, help="citygml, obj, or citygml,obj.")
@click.option("--terrain/--no-terrain", default=True, show_default=True, help="Write elevation and orthophoto.")
@click.option("--trees/--no-trees", default=True, show_default=True, help="Write trees.")
@click.option("--crs", default="EPSG:25832", show_default=True, help="Coordinate system of the files.")
@click.option("--workers", type=click.IntRange(1), default=usable_cores, show_default="one per core", help="Number of parallel processes.")
@click.option("--estimate", is_flag=True, help="Only print the disk space that the town needs, within about 15 %; write nothing.")
@json_option
def command(out: Path, formats: str, workers: int, estimate: bool, as_json: bool, **spec: Any) -> None:
    """Generate a town of any size for trying map3d: textured buildings, terrain, trees.

    If interrupted, re-run it to complete the town.
    """
    from map3d_town import TownSpec, estimate_town, make_town

    town = TownSpec(formats=tuple(part.strip() for part in formats.split(",")), **spec)
    if estimate:
        need = estimate_town(town)
        text = f"about {size_text(need.disk_bytes)}: {need.textures:,} textures, orthophoto {need.ortho_side_px:,} px wide"
        print_json(asdict(need)) if as_json else click.echo(text)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with progress_bar(*columns) as bar:
        task = bar.add_task("generating a town", total=None)
        report = make_town(out, town, lambda stage, done, total: bar.update(task, description=stage, completed=done, total=total), workers)
    if as_json:
        print_json(asdict(report))
    else:
        click.echo(f"{report.buildings:,} buildings, {report.trees:,} trees, {report.textures:,} textures, {size_text(report.disk_bytes)} in {out}")
        click.echo(f"next: map3d site {out} -o SITE")


@click.command("teatime")
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("teatime"), show_default=True, help="Output folder.")
def teatime(out: Path) -> None:
    """Write the teatime scene as OBJ files: a teapot at the origin and a cube next to it."""
    from map3d_town.teatime import write_teatime

    write_teatime(out)
    click.echo(f"wrote {out}; next: map3d site {out} -o teatime-site")
