"""map3d jobs: a group whose default command shows progress."""

import importlib
from typing import Final

import click

COMMANDS: Final = {
    "show": "jobs_show",
    "retry": "retry",
    "cancel": "jobs_cancel",
    "repair": "jobs_repair",
    "reproduce": "jobs_reproduce",
}


class JobCommands(click.Group):
    """`map3d jobs [RENDERING]` means `map3d jobs show [RENDERING]`."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"map3d.cli.{COMMANDS[cmd_name]}").command
        return command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or (args[0] not in COMMANDS and args[0] not in ctx.help_option_names):
            args = ["show", *args]
        return super().parse_args(ctx, args)


@click.group("jobs", cls=JobCommands, subcommand_metavar="[RENDERING] [OPTIONS] | COMMAND [ARGS]...")
def command() -> None:
    """Show progress, workers and failures; retry, cancel, repair and reproduce blocks.

    \b
    map3d jobs                   all renderings in one table
    map3d jobs RENDERING         one rendering; the same as map3d jobs show RENDERING
    map3d jobs RENDERING --watch keep the display up to date
    """
