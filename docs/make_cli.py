"""`python docs/make_cli.py`: writes docs/cli.md, the reference of the command line, from the help of the commands."""

from pathlib import Path
from typing import Final

import click

from map3d.cli.app import COMMANDS, cli
from map3d.errors import EXIT_CODES

TARGET: Final = Path(__file__).with_name("cli.md")
HEAD: Final = "# Command line\n\nWritten by `make docs` from the commands' own help. All commands accept `-h`, `--help`.\n"


def reference() -> str:
    parts = [HEAD, exit_codes(), section("map3d", cli)]
    with click.Context(cli, info_name="map3d") as context:
        for name in COMMANDS:
            command = cli.get_command(context, name)
            assert command is not None
            parts += sections(f"map3d {name}", command)
    return "\n".join(parts)


def exit_codes() -> str:
    """Returns the table of the exit codes."""
    rows = "\n".join(f"| {code} | {meaning} |" for code, meaning in EXIT_CODES.items())
    return f"## Exit codes\n\n| code | meaning |\n|--:|---|\n{rows}\n"


def sections(name: str, command: click.Command) -> list[str]:
    """Returns the section of a command, and those of its own commands."""
    parts = [section(name, command)]
    if isinstance(command, click.Group):
        with click.Context(command, info_name=name) as context:
            for own in command.list_commands(context):
                found = command.get_command(context, own)
                assert found is not None
                parts += sections(f"{name} {own}", found)
    return parts


def section(name: str, command: click.Command) -> str:
    settings = {**cli.context_settings, "terminal_width": 110, "max_content_width": 110}
    with click.Context(command, info_name=name, **settings) as context:
        return f"## {name}\n\n```text\n{command.get_help(context)}\n```\n"


if __name__ == "__main__":
    TARGET.write_text(reference(), encoding="utf-8")
    print(TARGET)
