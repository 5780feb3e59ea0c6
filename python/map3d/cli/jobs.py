"""map3d jobs: a group whose default command shows progress."""

from typing import Final

import click

from map3d.cli.lazy_group import LazyGroup

COMMANDS: Final = {
    "show": "jobs_show",
    "retry": "retry",
    "cancel": "jobs_cancel",
    "repair": "jobs_repair",
    "reproduce": "jobs_reproduce",
}


class JobCommands(LazyGroup):
    """`map3d jobs [RENDERING]` means `map3d jobs show [RENDERING]`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or (args[0] not in COMMANDS and args[0] not in ctx.help_option_names):
            args = ["show", *args]
        return super().parse_args(ctx, args)


@click.group("jobs", cls=JobCommands, modules=COMMANDS, subcommand_metavar="[RENDERING] [OPTIONS] | COMMAND [ARGS]...")
def command() -> None:
    """Show progress, workers and failures; retry, cancel, repair and reproduce blocks.

    \b
    map3d jobs                   all renderings in one table
    map3d jobs RENDERING         one rendering; the same as map3d jobs show RENDERING
    map3d jobs RENDERING --watch keep the display up to date
    """
