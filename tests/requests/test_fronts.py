"""The command line, the REST API and the library offer every field of every request, with the same default, choices, limits and help."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date, datetime
from typing import Any

import click
import pytest

from map3d import requests
from map3d.cli.app import cli
from map3d.geometry.sun import GeographicPosition, SunAngles
from map3d.library import LibraryRendering, LibraryScene, LibraryWorkspace
from map3d.operations.arguments import ARGUMENTS
from map3d.requests.json_values import from_json, schemas_of
from map3d.requests.param import FRONTS, RequestField, fields_of, help_text
from map3d.requests.renderings import BuildAndCreateRendering
from map3d.requests.scenes import BuildSteps
from map3d.types import ViewAngles
from map3d.web.api.schemas import SCHEMAS


@dataclass(frozen=True)
class Verb:
    """`command`: on the command line, whose request may have more fields (`builds_too`); `schemas`: name → schema in the REST API; `method`: of the
    library. None and empty where the front does not have the verb."""

    request: type
    command: str | None
    schemas: Mapping[str, Any] | None = None
    method: Any = None
    builds_too: type | None = None


def properties(*names: str) -> dict[str, Any]:
    return {name: schema for one in names for name, schema in SCHEMAS[one]["properties"].items()}


NEW_SCENE = properties("NewScene") | properties("NewScene")["options"]["properties"]
EXACT = {"sun", "place", "window", "offset", "start_view"}
"""Lists of as many numbers as the value has."""
IMPORT = ARGUMENTS["import"]["properties"]["options"]["properties"]
VERBS = [
    Verb(requests.CreateScene, "create-scene", NEW_SCENE, LibraryWorkspace.create_scene),
    Verb(requests.AddFiles, "add-files", IMPORT, LibraryScene.add_files),
    Verb(requests.Inspect, "inspect"),
    Verb(requests.Build, None, properties("BuildArguments"), LibraryScene.build),
    Verb(requests.CreateRendering, "create-rendering", properties("NewRendering"), LibraryScene.create_rendering, BuildAndCreateRendering),
    Verb(requests.ChangeRendering, "change-rendering", properties("RenderingChange"), LibraryRendering.change),
    Verb(requests.AddViews, "add-views"),
    Verb(requests.AddLayers, "add-layers"),
    Verb(requests.Estimate, "estimate", None, LibraryRendering.estimate),
    Verb(requests.Render, "render", properties("RenderArguments"), LibraryRendering.render),
    Verb(requests.Publish, "publish", properties("PublishArguments"), LibraryRendering.publish),
    Verb(requests.Export, "export"),
    Verb(requests.RemoveScene, "remove-scene", properties("RemoveArguments"), LibraryScene.remove),
    Verb(requests.RemoveFiles, "remove-files", properties("RemoveArguments"), LibraryScene.remove_files),
    Verb(requests.RemoveRendering, "remove-rendering", properties("RemoveArguments"), LibraryRendering.remove),
    Verb(requests.RemovePublished, None, properties("RemoveArguments")),
    Verb(requests.Site, "site"),
]
COMMON = {"workspace", "as_json", "yes", "with_stats", "help"}
"""Options of the command line that say how a command speaks, not what it does."""
TARGETS = {"scene", "rendering", "files"}
"""Arguments that name what a command is about; the object of a method, and the target of an operation."""


def ids(verb: Verb) -> str:
    return verb.request.__name__


def test_every_request_is_compared() -> None:
    assert {verb.request.__name__ for verb in VERBS} == set(requests.__all__) - {"LayerDetails"}


@pytest.mark.parametrize("verb", VERBS, ids=ids)
def test_fields_name_the_fronts_that_lack_them_with_a_reason(verb: Verb) -> None:
    for one in fields_of(verb.request).values():
        assert set(one.param.lacks) <= set(FRONTS)
        assert all(len(reason.split()) > 2 for reason in one.param.lacks.values()), one.name
        assert one.param.help[:1].isupper()
        assert one.param.help.endswith("."), one.name


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb.command], ids=ids)
def test_command_line_has_every_field(verb: Verb) -> None:
    assert verb.command is not None
    command = cli.get_command(click.Context(cli), verb.command)
    assert command is not None
    options = {parameter.name: parameter for parameter in command.params}
    request = verb.builds_too or verb.request
    wanted = {name: one for name, one in fields_of(request).items() if one.is_on("cli")}
    assert set(options) - COMMON - TARGETS == set(wanted) - TARGETS
    for name, one in wanted.items():
        if not one.param.argument:
            check_option(request, one, options[name])


def check_option(request: type, one: RequestField, option: click.Parameter) -> None:
    assert isinstance(option, click.Option)
    assert option.opts == one.option.partition("/")[0].split("/") if one.kind is bool else option.opts == one.option.split("/")
    assert option.help is not None
    assert option.help.startswith(help_text(request, one.name, "cli").removesuffix("."))
    assert option.help.endswith(f"[default: {one.param.default}]") == bool(one.param.default)
    if not one.required:
        assert (option.to_info_dict()["default"] or None) == (one.value or None)
    if one.param.choices:
        assert isinstance(option.type, click.Choice)
        assert tuple(option.type.choices) == one.param.choices
    elif isinstance(option.type, click.IntRange | click.FloatRange):
        assert (option.type.min, option.type.max) == (one.param.minimum, one.param.maximum)
    else:
        assert one.param.is_size or one.kind not in (int, float) or (one.param.minimum, one.param.maximum) == (None, None)


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb.schemas], ids=ids)
def test_rest_has_every_field(verb: Verb) -> None:
    assert verb.schemas is not None
    for one in fields_of(verb.request).values():
        if not one.is_on("rest"):
            assert one.rest not in verb.schemas, one.name
            continue
        schema = verb.schemas[one.rest]
        if one.required:
            continue
        assert help_text(verb.request, one.name, "rest") in schema["description"]
        assert tuple(schema.get("enum", ())) == one.param.choices
        limits = schema.get("minimum", schema.get("minItems")), schema.get("maximum", schema.get("maxItems"))
        assert limits == (one.param.minimum, one.param.maximum) or one.name in EXACT
        if one.value not in (None, "", ()) and not one.param.default:
            assert schema["default"] == one.value


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb.method], ids=ids)
def test_library_has_every_field_as_a_keyword(verb: Verb) -> None:
    keywords = {name: one for name, one in inspect.signature(verb.method).parameters.items() if name not in ("self", "progress", "files")}
    keywords |= {name: one for name, one in inspect.signature(verb.method).parameters.items() if name == "files" and one.kind is one.KEYWORD_ONLY}
    wanted = {name: one for name, one in fields_of(verb.request).items() if one.is_on("library")}
    assert set(keywords) == set(wanted)
    for name, one in wanted.items():
        default = keywords[name].default
        assert (default is inspect.Parameter.empty) == (one.required or name == "out")
        assert one.required or name == "out" or (default or None) == (one.value or None), name


def test_methods_without_a_request_of_their_own_take_its_fields() -> None:
    keywords = inspect.signature(LibraryRendering.add_layers).parameters
    for name, one in fields_of(requests.AddLayers).items():
        assert name == "layers" or keywords[name].default == one.value


def test_json_values_become_the_fields() -> None:
    values = {
        "scene": "s",
        "name": "r",
        "views": [[45, 22.5]],
        "res_m": 1,
        "window": [1, 2, 3],
        "layers": ["color"],
        "time": "2026-06-21T15:00+02:00",
        "sun": [195, 60],
        "day": "2026-06-21",
        "place": [48.76, 11.42],
        "pitch": 30,
    }
    made = from_json(requests.CreateRendering, values)
    assert (made.views, made.res_m, made.window, made.layers, made.pitch) == ((ViewAngles(45, 22.5),), 1.0, (1, 2, 3), ("color",), (30.0,))
    assert (made.sun, made.place, made.day) == (SunAngles(195, 60), GeographicPosition(48.76, 11.42), date(2026, 6, 21))
    assert made.time == datetime.fromisoformat("2026-06-21T15:00+02:00")
    assert from_json(requests.CreateRendering, {"scene": "s", "name": "r", "pitch": [30, 60]}).pitch == (30, 60)


def test_steps_of_the_build_are_options_of_a_new_scene() -> None:
    assert properties("NewScene")["options"]["properties"] == schemas_of(BuildSteps)
