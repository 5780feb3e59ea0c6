"""map3d operations: list, show, cancel, retry, as text and as JSON."""

import json

import pytest

from map3d.catalogue import SceneRecord, Workspace
from map3d.cli.app import run
from map3d.operations.request_operation import request_operation


@pytest.fixture
def ask(tmp_path, capsys):
    """Runs `map3d operations` in a workspace whose operation 1 is a build that waits; returns what it prints."""
    workspace = Workspace(tmp_path / "ws").create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town"))
    assert request_operation(workspace, catalogue, "build", "town", {}, "anna").id == "1"
    catalogue.close()

    def ask(*words, status=0):
        assert run(["operations", *words, "-w", str(workspace.root)]) == status
        return capsys.readouterr()

    return ask


def test_an_operation_is_shown_cancelled_and_retried(ask):
    assert ask("show", "1").out.startswith("operation 1: build town, asked for by anna at ")
    assert ask("cancel", "1").out == "operation 1: cancelled\n"
    assert "cancelled" in ask("show", "1").out.splitlines()[1]
    assert ask("retry", "1").out == "operation 1 waits for an operation worker: map3d serve, or map3d work --operations\n"
    assert ask("show", "1").out.splitlines()[1].startswith("waiting: ")


def test_each_prints_one_json_document(ask):
    shown = json.loads(ask("show", "1", "--json").out)
    assert (shown["operation"]["kind"], shown["operation"]["state"], shown["log"]) == ("build", "waiting", [])
    assert json.loads(ask("cancel", "1", "--json").out)["state"] == "cancelled"
    assert json.loads(ask("retry", "1", "--json").out)["state"] == "waiting"


@pytest.mark.parametrize("word", ["show", "cancel", "retry"])
def test_an_unknown_operation_is_refused(ask, word):
    assert ask(word, "7", status=2).err == "map3d: no operation '7'; map3d operations lists them\n"
