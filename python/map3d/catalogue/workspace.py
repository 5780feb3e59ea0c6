"""Paths in a workspace (spec/scene.md)."""

from dataclasses import dataclass
from pathlib import Path

from map3d.catalogue.contract import LEASE_S, Catalogue
from map3d.catalogue.sqlite import SqliteCatalogue
from map3d.errors import NotFound
from map3d.types import check_name


@dataclass(frozen=True)
class Workspace:
    """The folder of catalogue, scenes and renderings. Names are checked, so that no path leaves the folder."""

    root: Path

    @property
    def catalogue_path(self) -> Path:
        return self.root / "catalogue.sqlite"

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

    def open_catalogue(self, *, lease_s: float = LEASE_S) -> Catalogue:
        """Opens the catalogue. Raises NotFound when the workspace does not exist."""
        if not self.root.is_dir():
            raise NotFound(f"no workspace at {self.root}: create a scene first with map3d create-scene, or name another folder with --workspace")
        return SqliteCatalogue(self.catalogue_path, lease_s=lease_s)
