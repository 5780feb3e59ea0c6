"""Paths in a workspace (spec/scene.md), and the URL of its catalogue (spec/catalogue.md)."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from map3d.catalogue.catalogue_url import has_password, redact_url
from map3d.catalogue.contract import LEASE_S, Catalogue
from map3d.catalogue.open_catalogue import open_catalogue
from map3d.errors import AlreadyExists, BadRequest, Corrupt, NotFound
from map3d.types import check_name

CATALOGUE_VARIABLE: Final = "MAP3D_CATALOGUE"


@dataclass(frozen=True)
class Workspace:
    """The folder of scenes and renderings, and of their catalogue unless `catalogue_url` names another place. Names are checked, so that no path
    leaves the folder."""

    root: Path
    catalogue_url: str | None = None

    @property
    def catalogue_path(self) -> Path:
        return self.root / "catalogue.sqlite"

    @property
    def settings_path(self) -> Path:
        return self.root / "workspace.json"

    def scene_folder(self, scene: str) -> Path:
        return self.root / "scenes" / check_name(scene, "scene")

    def registry_path(self, scene: str) -> Path:
        return self.scene_folder(scene) / "registry.sqlite"

    def asset_folder(self, scene: str, asset: str) -> Path:
        return self.scene_folder(scene) / "assets" / check_name(asset, "asset")

    def rendering_folder(self, rendering: str) -> Path:
        return self.root / "renderings" / check_name(rendering, "rendering")

    def manifest_path(self, rendering: str) -> Path:
        return self.rendering_folder(rendering) / "rendering.json"

    def store_path(self, rendering: str, track: str) -> Path:
        return self.rendering_folder(rendering) / f"{track}.sqlite"

    def create(self) -> "Workspace":
        """Creates the folder when it does not exist."""
        self.root.mkdir(parents=True, exist_ok=True)
        return self

    def find_catalogue_url(self) -> str | None:
        """Returns `catalogue_url`, else the environment variable MAP3D_CATALOGUE, else the URL in workspace.json; None stands for the SQLite file in
        the folder. Raises Corrupt."""
        return self.catalogue_url or os.environ.get(CATALOGUE_VARIABLE) or self._stored_url()

    def _stored_url(self) -> str | None:
        try:
            settings = json.loads(self.settings_path.read_bytes())
            url = settings.get("catalogue")
        except FileNotFoundError:
            return None
        except (ValueError, AttributeError):
            url = ()
        if url is not None and not isinstance(url, str):
            raise Corrupt(f'{self.settings_path}: expected {{"catalogue": URL}}; correct the file, or remove it to use the catalogue in the folder')
        return url

    def check_catalogue_url(self, url: str) -> None:
        """Raises BadRequest for a URL with a password, AlreadyExists when the workspace has another catalogue."""
        if has_password(url):
            raise BadRequest(f"{redact_url(url)}: passwords are not stored; give this URL in the environment variable {CATALOGUE_VARIABLE} instead")
        stored = self._stored_url()
        if stored not in (None, url) or (stored is None and self.catalogue_path.exists()):
            present = redact_url(stored or self.catalogue_path.name)
            raise AlreadyExists(f"workspace {self.root}: already has the catalogue {present}; choose another folder")

    def store_catalogue_url(self, url: str) -> None:
        """Writes workspace.json; raises like `check_catalogue_url`."""
        self.check_catalogue_url(url)
        draft = self.settings_path.with_name(f".workspace.json.{os.getpid()}.new")
        draft.write_text(json.dumps({"catalogue": url}) + "\n", encoding="utf-8")
        draft.replace(self.settings_path)

    def open_catalogue(self, *, lease_s: float = LEASE_S, wait_s: float | None = None) -> Catalogue:
        """Opens the catalogue. `wait_s`: how long a call may wait for the database, by default as long as a restart of it takes. Raises NotFound
        when neither the workspace nor a URL of its catalogue exists, or when a workspace with scenes or renderings has lost its catalogue."""
        url = self.find_catalogue_url()
        if url is not None:
            return open_catalogue(url, lease_s=lease_s, wait_s=wait_s)
        if not self.root.is_dir():
            raise NotFound(f"no workspace at {self.root}: create a scene first with map3d create-scene, or name another folder with --workspace")
        if not self.catalogue_path.exists() and ((self.root / "scenes").is_dir() or (self.root / "renderings").is_dir()):
            raise NotFound(
                f"{self.catalogue_path}: no such file, though the workspace has scenes or renderings; restore it from a backup, "
                f"or name the catalogue in the environment variable {CATALOGUE_VARIABLE}"
            )
        return open_catalogue(str(self.catalogue_path), lease_s=lease_s, wait_s=wait_s)
