"""Help, errors and listings of the commands, without a built scene."""

import json
from pathlib import Path

import click
import pytest

from map3d import __version__
from map3d.cli.app import COMMANDS
from map3d.cli.option_types import Bytes, View
from map3d.types import ViewAngles
from tests.cli.towns import Run


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_every_command_and_option_has_a_help_text(run: Run, command: str) -> None:
    status, out, err = run(command, "--help")
    assert (status, err) == (0, "")
    assert out.startswith(f"Usage: map3d {command}")
    assert all(not line.strip().startswith("--") or len(line.split()) > 1 for line in out.splitlines())


def test_help_lists_the_verbs_in_the_order_of_use(run: Run) -> None:
    for arguments in ((), ("--help",), ("-h",)):
        status, out, _ = run(*arguments)
        assert status == 0
        places = [out.rindex(f"\n  {command} ") for command in COMMANDS]
        assert places == sorted(places)


def test_help_lists_whole_sentences(run: Run) -> None:
    commands = run("--help")[1].split("\nCommands:\n")[1]
    assert "..." not in commands
    assert "Import FILES into SCENE: CityGML, OBJ, and GeoTIFF rasters of elevation and imagery." in " ".join(commands.split())


def test_version(run: Run) -> None:
    assert run("--version")[1].strip() == f"map3d, version {__version__}"


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (("rendre",), 2, "No such command 'rendre'. Did you mean render? See map3d --help."),
        (("publicise-everything",), 2, "No such command 'publicise-everything'. See map3d --help."),
        (("render",), 2, "map3d render --help"),
        (("render", "x", "--workers", "0"), 2, "--workers"),
        (("render", "x"), 2, "create-scene"),
        (("show", "scenes"), 2, "create-scene"),
        (("show", "jobs"), 2, "map3d: show jobs: missing NAME"),
        (("serve",), 2, "create-scene"),
        (("verify",), 2, "create-scene"),
        (("create-scene", "Bad Name"), 2, "scene name"),
        (("create-scene", "a", "--crs", "EPSG:4326"), 2, "projected"),
        (("create-scene", "a", "--crs", "nonsense"), 2, "--crs"),
        (("add-files", "a"), 2, "FILES"),
        (("create-rendering", "a", "b", "--view", "north"), 2, "e.g. 45-22.5 or 45/22.5"),
        (("create-rendering", "a", "b", "--view", "400-45"), 2, "from north). See map3d create-rendering --help."),
        (("create-rendering", "a", "b", "--window", "0,0"), 2, "691000,5336000,2000. See map3d create-rendering --help."),
        (("make-town", "-o", "t", "--formats", "shp"), 1, "formats is 'shp', expected one or more of citygml, obj"),
    ],
)
def test_error_is_one_line_that_says_what_to_do(run: Run, arguments: tuple[str, ...], status: int, says: str) -> None:
    got, _, err = run(*arguments)
    assert got == status
    assert err.startswith("map3d: ")
    assert err.count("\n") == 1
    assert says in err
    assert "Traceback" not in err


def test_traceback_is_printed_only_on_request(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAP3D_DEBUG", "1")
    _, _, err = run("show", "scenes")
    assert "Traceback" in err
    assert err.splitlines()[-1].startswith("map3d: ")


def test_created_scenes_are_shown(run: Run) -> None:
    assert run("create-scene", "town", "--crs", "urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH", "--title", "Town", "--no-merge-faces")[0] == 0
    status, _, err = run("create-scene", "town")
    assert (status, "exists already" in err) == (2, True)
    assert json.loads(run("create-scene", "other", "--json")[1])["crs"] is None
    (other, town) = json.loads(run("show", "scenes", "--json")[1])
    assert (other["scene"]["name"], other["assets"]) == ("other", [])
    assert town["scene"]["crs"]["epsg"] == 25832
    assert town["scene"]["crs"]["vertical"] == "DHHN2016 height"
    assert town["scene"]["options"]["merge_faces"] is False
    assert "ETRS89 / UTM zone 32N" in run("show", "scenes")[1]
    assert run("show", "report", "town")[0] == 0
    status, out, _ = run("show", "scene", "town")
    assert (status, "no origin yet" in out, "merge-faces off" in out) == (0, True, True)
    assert json.loads(run("show", "renderings", "--json")[1]) == []
    assert "map3d create-rendering" in run("show")[1]


def test_unknown_name_lists_the_existing_ones(run: Run) -> None:
    run("create-scene", "town")
    status, _, err = run("show", "scene", "twon")
    assert (status, "existing scenes: town" in err) == (2, True)
    for arguments in (("render", "x"), ("estimate", "x"), ("retry", "x"), ("verify", "x"), ("show", "jobs", "x"), ("show", "quarantine", "x")):
        status, _, err = run(*arguments)
        assert (status, "no rendering 'x'" in err) == (2, True), arguments


def test_file_of_unknown_format_is_refused_naming_the_known_formats(run: Run, tmp_path: Path) -> None:
    run("create-scene", "town")
    (tmp_path / "a.skp").write_bytes(b"\xff\xfe\xff\x0eSketchUp")
    status, _, err = run("add-files", "town", "a.skp")
    assert (status, "CityGML" in err, "OBJ" in err) == (2, True, True)
    status, _, err = run("add-files", "town", "nothing.obj")
    assert (status, "no such file" in err) == (2, True)


def test_scene_without_files_is_refused(run: Run) -> None:
    run("create-scene", "town")
    status, _, err = run("create-rendering", "town", "r", "--res", "1")
    assert (status, "add-files" in err) == (2, True)


def test_conflicting_options_are_refused(run: Run) -> None:
    run("create-scene", "town")
    for arguments in (("--view", "0/45", "--directions", "4"), ("--layers", "color,colour"), ("--layers", "id,id")):
        status, _, err = run("create-rendering", "town", "r", "--res", "1", *arguments)
        assert (status, err.count("\n")) == (2, 1), err


@pytest.mark.parametrize(
    ("text", "size"), [("512M", 512 << 20), ("2G", 2 << 30), ("1.5g", 3 << 29), ("100", 100), ("64 MiB", 64 << 20), ("1kB", 1024)]
)
def test_sizes(text: str, size: int) -> None:
    assert Bytes().convert(text, None, None) == size


@pytest.mark.parametrize("text", ["", "-1", "many", "1X", "0", "1e9"])
def test_invalid_size(text: str) -> None:
    with pytest.raises(Exception, match="not a size"):
        Bytes().convert(text, None, None)


@pytest.mark.parametrize(
    ("text", "view"), [("45-22.5", (45.0, 22.5)), ("45/22.5", (45.0, 22.5)), ("90", (90.0, 45.0)), ("0-90", (0.0, 90.0)), ("359.5/1", (359.5, 1.0))]
)
def test_views(text: str, view: tuple[float, float]) -> None:
    assert View().convert(text, None, None) == ViewAngles(*view)


@pytest.mark.parametrize("text", ["", "north", "45-", "45/22/5", "45-22-5", "-45/22", "360-45", "0-0", "0-91", "nan/45", "45/nan"])
def test_invalid_view(text: str) -> None:
    with pytest.raises(click.BadParameter):
        View().convert(text, None, None)


def test_scripts_run_the_same_commands(run: Run, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    from map3d.cli import scripts

    for function, command in (
        (scripts.create_scene, "create-scene"),
        (scripts.add_files_to_scene, "add-files"),
        (scripts.create_rendering, "create-rendering"),
    ):
        monkeypatch.setattr("sys.argv", ["script.py", "--help"])
        with pytest.raises(SystemExit) as ended:
            function()
        assert ended.value.code == 0
        assert f"map3d {command}" in capfd.readouterr().out
