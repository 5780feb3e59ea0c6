"""The exit codes of the command line are those of `EXIT_CODES`, which docs/cli.md lists."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d import cli
from map3d.cli import app
from map3d.errors import EXIT_CODES, FAILED, IN_PART, INTERRUPTED, INVALID, Map3dError
from tests.cli.bad_files import elevation
from tests.cli.towns import Run, write_town


def subclasses(kind: type[Map3dError]) -> Iterator[type[Map3dError]]:
    yield kind
    for one in kind.__subclasses__():
        yield from subclasses(one)


def test_every_error_has_a_documented_code() -> None:
    assert {one.exit_code for one in subclasses(Map3dError)} == {FAILED, INVALID}
    documented = (Path(__file__).parents[2] / "docs" / "cli.md").read_text(encoding="utf-8")
    assert [int(code) for code in re.findall(r"^\| (\d+) \|", documented, re.MULTILINE)] == list(EXIT_CODES)


def test_commands_exit_with_named_codes() -> None:
    for path in Path(cli.__path__[0]).glob("*.py"):
        found = re.findall(r"\bExit\(([^)]*)\)", path.read_text(encoding="utf-8"))
        assert not [code for code in found if any(character.isdigit() for character in code)], path


@pytest.mark.parametrize("kind", [KeyboardInterrupt, ValueError])
def test_interrupts_and_bugs_have_codes(monkeypatch: pytest.MonkeyPatch, kind: type[BaseException]) -> None:
    def fail(*_: object, **__: object) -> None:
        raise kind

    monkeypatch.setattr(app.cli, "main", fail)
    assert app.run([]) == (INTERRUPTED if kind is KeyboardInterrupt else FAILED)


@pytest.mark.parametrize("command", [("add-files", "town"), ("inspect",)])
def test_files_that_fail_give_a_code(run: Run, tmp_path: Path, command: tuple[str, ...]) -> None:
    run("create-scene", "town")
    folder = write_town(tmp_path / "city", 1)
    elevation(folder / "plain.tif")
    assert run(*command, "city")[0] == 0
    (folder / "cut.tif").write_bytes((folder / "plain.tif").read_bytes()[:-100])
    assert run(*command, "city")[0] == IN_PART
    (folder / "empty.gml").touch()
    assert run(*command, "city")[0] == FAILED
    assert run(*command, "missing")[0] == INVALID


@pytest.mark.parametrize("manifest", ['{"map3d": "rendering", "name": "other", "origin": [1, 2, 3]}', "thesis"])
def test_site_refuses_the_folder_of_another_map_before_it_imports(run: Run, tmp_path: Path, manifest: str) -> None:
    write_town(tmp_path / "city", 1)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "rendering.json").write_text(manifest)
    status, out, err = run("site", "city", "-o", "out")
    assert (status, out, "--replace" in err) == (INVALID, "", manifest != "thesis")
    assert (tmp_path / "out" / "rendering.json").read_text() == manifest
    assert not (tmp_path / "workspace").exists()


def test_site_refuses_the_folder_of_a_map_of_the_same_name_elsewhere(run: Run, tmp_path: Path) -> None:
    write_town(tmp_path / "city", 1)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "rendering.json").write_text('{"map3d": "rendering", "name": "city", "origin": [1, 2, 3]}')
    status, _, err = run("site", "city", "-o", "out")
    assert status == INVALID
    assert "another scene" in err
    assert not list((tmp_path / "workspace").rglob("rendering.json"))
