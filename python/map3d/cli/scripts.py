"""createScene.py, addFilesToScene.py, createRendering.py: three commands under the names of map3d's predecessor."""

import sys

from map3d.cli.app import run


def create_scene() -> None:
    sys.exit(run(["create-scene", *sys.argv[1:]]))


def add_files_to_scene() -> None:
    sys.exit(run(["add-files", *sys.argv[1:]]))


def create_rendering() -> None:
    sys.exit(run(["create-rendering", *sys.argv[1:]]))
