"""The command line: one file for each command or group of commands; each parses options, calls one function and formats its result."""

from map3d.cli.app import cli, main

__all__ = ["cli", "main"]
