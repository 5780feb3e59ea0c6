"""The command line: one file per command, without logic of its own."""

from map3d.cli.app import cli, main

__all__ = ["cli", "main"]
