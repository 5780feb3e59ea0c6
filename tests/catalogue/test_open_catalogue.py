"""Which catalogue a workspace opens, and that passwords are neither stored nor printed."""

import json
from pathlib import Path

import pytest

from map3d.catalogue import SceneRecord, Workspace, open_catalogue
from map3d.catalogue.catalogue_url import has_password, redact_url
from map3d.errors import AlreadyExists, BadRequest, Corrupt

PASSWORD = "s3cr3t"


@pytest.fixture(autouse=True)
def _no_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MAP3D_CATALOGUE", raising=False)


def scenes(workspace: Workspace) -> list[str]:
    catalogue = workspace.open_catalogue()
    try:
        return [scene.name for scene in catalogue.scenes()]
    finally:
        catalogue.close()


def catalogue_with_scene(path: Path, scene: str) -> str:
    url = f"sqlite://{path}"
    catalogue = open_catalogue(url)
    catalogue.create_scene(SceneRecord(scene))
    catalogue.close()
    return url


def test_argument_precedes_the_variable_and_the_variable_precedes_the_workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    urls = {name: catalogue_with_scene(tmp_path / f"{name}.sqlite", name) for name in ("argument", "variable", "stored")}
    (tmp_path / "folder").mkdir()
    catalogue_with_scene(tmp_path / "folder" / "catalogue.sqlite", "folder")
    assert scenes(Workspace(tmp_path / "folder")) == ["folder"]
    workspace = Workspace(tmp_path / "workspace").create()
    workspace.store_catalogue_url(urls["stored"])
    assert scenes(workspace) == ["stored"]
    monkeypatch.setenv("MAP3D_CATALOGUE", urls["variable"])
    assert scenes(workspace) == scenes(Workspace(tmp_path / "node")) == ["variable"], "a node's folder may be empty"
    assert scenes(Workspace(workspace.root, urls["argument"])) == ["argument"]
    assert not workspace.catalogue_path.exists()


def test_stored_url_survives_and_is_not_replaced_by_another(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.store_catalogue_url("mongodb://db/town")
    workspace.store_catalogue_url("mongodb://db/town")
    assert json.loads((tmp_path / "workspace.json").read_text()) == {"catalogue": "mongodb://db/town"}
    with pytest.raises(AlreadyExists, match="mongodb://db/town"):
        workspace.store_catalogue_url("mongodb://db/other")


def test_workspace_with_a_catalogue_in_its_folder_takes_no_url(tmp_path: Path) -> None:
    Workspace(tmp_path).open_catalogue().close()
    with pytest.raises(AlreadyExists, match=r"catalogue\.sqlite"):
        Workspace(tmp_path).store_catalogue_url("mongodb://db/town")


@pytest.mark.parametrize("text", ["", "[]", '{"catalogue": 5}', "{"])
def test_damaged_settings_are_reported(tmp_path: Path, text: str) -> None:
    (tmp_path / "workspace.json").write_text(text)
    with pytest.raises(Corrupt, match=r"workspace\.json"):
        Workspace(tmp_path).open_catalogue()


@pytest.mark.parametrize(
    ("url", "redacted"),
    [
        (f"mongodb://me:{PASSWORD}@db:27017/town", "mongodb://me:***@db:27017/town"),
        (f"mongodb+srv://me:{PASSWORD}@db/town?retryWrites=true", "mongodb+srv://me:***@db/town?retryWrites=true"),
        (f"mongodb://me:{PASSWORD}/@:x@db/town", "mongodb://me:***@db/town"),
        (f"mongodb://db/town?tlsCertificateKeyFilePassword={PASSWORD}&w=1", "mongodb://db/town?tlsCertificateKeyFilePassword=***&w=1"),
        (f"mongodb://db/town?authMechanismProperties=AWS_SESSION_TOKEN:{PASSWORD}", "mongodb://db/town?authMechanismProperties=***"),
        ("mongodb://me@db/town", "mongodb://me@db/town"),
        ("mongodb://db:27017,other:27018/town", "mongodb://db:27017,other:27018/town"),
        ("sqlite:///data/catalogue.sqlite", "sqlite:///data/catalogue.sqlite"),
    ],
)
def test_passwords_are_redacted_and_refused_where_they_would_be_stored(tmp_path: Path, url: str, redacted: str) -> None:
    assert redact_url(url) == redacted
    assert has_password(url) == (PASSWORD in url)
    if PASSWORD in url:
        with pytest.raises(BadRequest, match="MAP3D_CATALOGUE") as caught:
            Workspace(tmp_path).store_catalogue_url(url)
        assert PASSWORD not in str(caught.value)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("url", ["http://db/town", f"postgres://me:{PASSWORD}@db/town", "sqlite://relative"])
def test_unknown_url_is_refused(url: str) -> None:
    with pytest.raises(BadRequest, match="mongodb://HOST") as caught:
        open_catalogue(url)
    assert PASSWORD not in str(caught.value)


def test_a_new_file_is_for_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / "catalogue.sqlite"
    open_catalogue(str(path)).close()
    assert path.stat().st_mode & 0o777 == 0o600
    path.chmod(0o640)
    open_catalogue(str(path)).close()
    assert path.stat().st_mode & 0o777 == 0o640, "the owner's choice stays"
