"""The command line: one file for each command or group of commands, without logic of its own."""

from map3d.cli.app import cli, main

__all__ = ["cli", "main"]
