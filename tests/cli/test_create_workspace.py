"""map3d create-workspace."""

import json
from pathlib import Path
from uuid import uuid4

import pytest

from map3d.catalogue import Workspace
from map3d.cli.app import run


@pytest.fixture(autouse=True)
def _no_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MAP3D_CATALOGUE", raising=False)


def test_workspace_has_a_catalogue_in_its_folder_by_default(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = tmp_path / "workspace"
    assert run(["create-workspace", "-w", str(root), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"workspace": str(root), "catalogue": str(root / "catalogue.sqlite")}
    assert (root / "catalogue.sqlite").is_file()
    assert not (root / "workspace.json").exists()


def test_later_commands_use_the_stored_catalogue(tmp_path: Path, mongo_server: str, capsys: pytest.CaptureFixture[str]) -> None:
    root, url = tmp_path / "workspace", f"{mongo_server}/test_{uuid4().hex[:12]}"
    assert run(["create-workspace", "-w", str(root), "--catalogue", url]) == 0
    assert url in capsys.readouterr().out
    assert run(["create-scene", "town", "-w", str(root)]) == 0
    assert not Workspace(root).catalogue_path.exists()
    other = tmp_path / "other"
    assert run(["create-workspace", "-w", str(other), "--catalogue", url]) == 0
    capsys.readouterr()
    assert run(["show", "scenes", "-w", str(other), "--json"]) == 0
    assert [each["scene"]["name"] for each in json.loads(capsys.readouterr().out)] == ["town"]


@pytest.mark.parametrize("option", [True, False])
def test_password_is_neither_stored_nor_printed(
    tmp_path: Path, option: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    url = "mongodb://me:s3cr3t@127.0.0.1:9/town"
    monkeypatch.setattr("map3d.catalogue.mongodb_connection.CONNECT_S", 0.0)
    monkeypatch.setattr("map3d.catalogue.mongodb_connection._SELECTION_MS", 100)
    if not option:
        monkeypatch.setenv("MAP3D_CATALOGUE", url)
    monkeypatch.setenv("MAP3D_DEBUG", "1")
    arguments = ["create-workspace", "-w", str(tmp_path / "workspace"), *(["--catalogue", url] if option else [])]
    assert run(arguments) == (2 if option else 1)
    printed = capsys.readouterr()
    assert "mongodb://me:***@127.0.0.1:9/town" in printed.err
    assert "s3cr3t" not in printed.out + printed.err
    assert not any(b"s3cr3t" in path.read_bytes() for path in tmp_path.rglob("*") if path.is_file())
