"""The limits of the core, the schema and the command line are those of spec/limits.json."""

import json
import re
from pathlib import Path
from typing import Any

import click
import pytest

from map3d import _core, types
from map3d.cli.create_rendering import command as create_rendering
from map3d.errors import BadName

SPEC = Path(__file__).parents[2] / "spec"
LIMITS: dict[str, Any] = json.loads((SPEC / "limits.json").read_text())
SCHEMA: dict[str, Any] = json.loads((SPEC / "manifest.schema.json").read_text())
LAYER = SCHEMA["properties"]["layers"]["items"]["properties"]


def test_limits_of_the_core_are_those_of_the_specification() -> None:
    found = {
        "tile_px": list(_core.TILE_PX),
        "deepest_level": _core.DEEPEST_LEVEL,
        "quality": list(_core.QUALITY),
        "suns": _core.MAX_SUNS,
        "ao_radius_m": list(_core.AO_RADIUS_M),
        "name": _core.NAME_PATTERN,
        "objects_per_shard": _core.OBJECTS_PER_SHARD,
    }
    assert found == {key: LIMITS[key] for key in found}


def test_limits_of_the_manifests_schema_are_those_of_the_specification() -> None:
    properties = SCHEMA["properties"]
    assert properties["tile_px"]["enum"] == LIMITS["tile_px"]
    assert properties["zmax"]["maximum"] == LIMITS["deepest_level"]
    assert properties["objects"]["properties"]["shard_size"]["const"] == LIMITS["objects_per_shard"]
    assert LAYER["suns"]["maxItems"] == LIMITS["suns"]
    assert [LAYER["radius_m"]["minimum"], LAYER["radius_m"]["maximum"]] == LIMITS["ao_radius_m"]
    assert SCHEMA["$defs"]["name"]["pattern"] == f"^{LIMITS['name']}$"


def option(name: str) -> Any:
    return next(parameter.type for parameter in create_rendering.params if name in parameter.opts)


def test_limits_of_the_command_line_are_those_of_the_specification() -> None:
    assert isinstance(create_rendering, click.Command)
    assert [int(choice) for choice in option("--tile-size").choices] == LIMITS["tile_px"]
    assert (option("--levels").min, option("--levels").max) == (1, LIMITS["deepest_level"] + 1)
    assert [option("--ao-radius").min, option("--ao-radius").max] == LIMITS["ao_radius_m"]
    assert [option("--quality").min, option("--quality").max] == LIMITS["quality"]


@pytest.mark.parametrize("name", ["a", "0", "a-b_c", "x" * 64, "", "-a", "A", "a.b", "x" * 65, "a\n"])
def test_a_name_is_valid_if_and_only_if_it_matches_the_pattern(name: str) -> None:
    if re.fullmatch(LIMITS["name"], name):
        assert types.check_name(name, "layer") == name
    else:
        with pytest.raises(BadName):
            types.check_name(name, "layer")
