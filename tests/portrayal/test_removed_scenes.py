"""Stored views are removed with their scenes, also after a kill in between."""

import pytest

from map3d.catalogue import Workspace
from map3d.lifecycle.remove_scene import find_scene, finish_scene_removal, remove_scene
from map3d.portrayal.service import PortrayalService
from map3d.portrayal.tracer_pool import TracerPool
from map3d.renderings.view_store import views_folder
from tests.portrayal.conftest import FAKE, Ask
from tests.portrayal.queries import PERSPECTIVE, get_view


@pytest.mark.parametrize("killed", [False, True])
def test_stored_views_go_with_their_scene(
    ask: Ask, service: PortrayalService, workspace: Workspace, killed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask(get_view(projection=PERSPECTIVE))
    assert service._store.used_bytes() > 0
    catalogue = workspace.open_catalogue()
    found = find_scene(workspace, catalogue, "village", with_renderings=True)
    if killed:
        with monkeypatch.context() as patch:
            patch.setattr("map3d.lifecycle.remove_scene.remove_views", _die)
            with pytest.raises(KeyboardInterrupt):
                remove_scene(workspace, catalogue, found)
        assert service._store.used_bytes() > 0
        finish_scene_removal(workspace, catalogue, "village")
    else:
        remove_scene(workspace, catalogue, found)
    assert service._store.used_bytes() == 0
    assert not list(views_folder(workspace).glob("??/*"))
    catalogue.close()


def _die(*_: object) -> None:
    raise KeyboardInterrupt


def test_views_of_scenes_that_another_host_removed_go_at_the_next_start(ask: Ask, service: PortrayalService, workspace: Workspace) -> None:
    ask(get_view(projection=PERSPECTIVE))
    service._store.put("f" * 48, b"picture", ["elsewhere"])
    before = service._store.used_bytes()
    again = PortrayalService(workspace, pool=TracerPool(entry=FAKE, subprocesses=1), limit_bytes=1 << 30)
    again.close()
    assert 0 < service._store.used_bytes() < before
    assert service._store.get("f" * 48) is None
