"""The command line: one file per verb, no logic of its own."""

from map3d.cli.app import cli, main

__all__ = ["cli", "main"]
