"""map3d teatime."""

from pathlib import Path

import click


@click.command("teatime")
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("teatime"), show_default=True, help="Output folder.")
def command(out: Path) -> None:
    """Write the teatime scene as OBJ files: a teapot at the origin and a cube next to it."""
    from map3d_town.teatime import write_teatime

    write_teatime(out)
    click.echo(f"wrote {out}; next: map3d site {out} -o teatime-site")
