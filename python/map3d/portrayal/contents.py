"""The layers that the service offers: one per built scene, and in it one per asset."""

import hashlib
import json
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Final

from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.portrayal.request_crs import SceneSystems, systems_of
from map3d.portrayal.service_exception import ServiceException, invalid, quote
from map3d.portrayal.styles import DEFAULT_STYLE, find_style
from map3d.registry import RegisteredAsset, Registry
from map3d.registry.object_boxes import unite_boxes
from map3d.registry.registry import SCENE_ASSET
from map3d.scenes.scene_cache import scene_in_use
from map3d.types import Box

LOD_SCHEME: Final = "CityGML"
_KEPT_SCENES: Final = 256


@dataclass(frozen=True)
class AssetLayer:
    """The layer of an asset. `summary`: of its objects."""

    scene: str
    name: str
    title: str
    summary: RegisteredAsset

    @property
    def identifier(self) -> str:
        return f"{self.scene}/{self.name}"


@dataclass(frozen=True)
class SceneLayer:
    """The layer of a scene. `version` differs after each build; `greatest_id`: of its objects; `extent`: the
    local box of everything, also of the ground plane."""

    record: SceneRecord
    version: str
    assets: tuple[AssetLayer, ...]
    greatest_id: int
    extent: Box | None

    @property
    def identifier(self) -> str:
        return self.record.name

    @property
    def title(self) -> str:
        return self.record.title or self.record.name

    @cached_property
    def systems(self) -> SceneSystems:
        return systems_of(self.record)

    @cached_property
    def box(self) -> Box | None:
        """The local box of all objects."""
        box = None
        for asset in self.assets:
            box = unite_boxes(box, asset.summary.box)
        return box

    @cached_property
    def lods(self) -> tuple[str, ...]:
        """The levels of detail of all assets."""
        return tuple(sorted({lod for asset in self.assets for lod in asset.summary.lods}))


@dataclass(frozen=True)
class ChosenLayers:
    """Layers of a request within one scene, in one style. `assets`: None for the whole scene; `lods`: requested level by asset, or None."""

    scene: SceneLayer
    assets: tuple[str, ...] | None
    lods: Mapping[str, str | None]
    style: str = DEFAULT_STYLE


class _SceneChoice:
    """The layers that a request names within one scene. The style of an asset's own layer precedes that of the scene's."""

    def __init__(self, scene: SceneLayer) -> None:
        self.scene = scene
        self._lods: dict[str, str | None] = {}
        self._styles: dict[str, str] = {}

    def add(self, layer: str, assets: Sequence[AssetLayer], lod: str | None, style: str) -> None:
        """Raises InvalidParameterValue if the request names the layer twice, in different styles."""
        if self._styles.setdefault(layer, style) != style:
            raise invalid("styles", f"layer {quote(layer)} is requested in the styles {self._styles[layer]} and {style}; request one")
        self._lods.update((asset.name, lod) for asset in assets)

    def by_style(self) -> list[ChosenLayers]:
        whole = self._styles.get(self.scene.identifier, DEFAULT_STYLE)
        styles = {name: self._styles.get(f"{self.scene.identifier}/{name}", whole) for name in self._lods}
        lods = {name: lod for name, lod in self._lods.items() if lod is not None}
        if len(styles) == len(self.scene.assets) and not lods and len({*styles.values()}) <= 1:
            return [ChosenLayers(self.scene, None, {}, next(iter(styles.values()), whole))]
        if self.scene.identifier in self._styles and not lods:
            styles[SCENE_ASSET] = whole
        groups = [(style, [name for name in styles if styles[name] == style]) for style in sorted({*styles.values()})]
        return [ChosenLayers(self.scene, tuple(sorted(names)), {n: lods[n] for n in names if n in lods}, style) for style, names in groups]


class Contents:
    """All layers of a workspace at one moment."""

    def __init__(self, scenes: Sequence[SceneLayer]) -> None:
        self.scenes = tuple(scenes)

    @cached_property
    def version(self) -> str:
        """A digest that differs when the layers differ."""
        text = json.dumps([(scene.record.name, scene.title, scene.version, [asset.identifier for asset in scene.assets]) for scene in self.scenes])
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def scene(self, name: str) -> SceneLayer | None:
        return next((scene for scene in self.scenes if scene.identifier == name), None)

    def choose(self, names: Sequence[str], lods: Sequence[str] = (), styles: Sequence[str] = (), *, info: bool = False) -> list[ChosenLayers]:
        """Returns the layers by scene and style. No names choose the first scene.

        Raises InvalidParameterValue or, with `info`, UnknownLayer; LODNotDefined, LODNotApplicable, StyleNotDefined.
        """
        wanted = [find_style(style) for style in styles] or [DEFAULT_STYLE] * max(len(names), 1)
        if not self.scenes:
            raise ServiceException("NoApplicableCode", "no scene is built yet; run: map3d add-files, then map3d render", status=503)
        if not any(names):
            return [ChosenLayers(self.scenes[0], None, {}, wanted[0])]
        chosen: dict[str, _SceneChoice] = {}
        for number, name in enumerate(names):
            scene, assets = self._find(name, info)
            lod = self._check_lod(lods[number] if lods else "", assets)
            chosen.setdefault(scene.identifier, _SceneChoice(scene)).add(name, assets, lod, wanted[number])
        return [layers for _, choice in sorted(chosen.items()) for layers in choice.by_style()]

    def _find(self, name: str, info: bool) -> tuple[SceneLayer, Sequence[AssetLayer]]:
        scene_name, slash, asset_name = name.partition("/")
        scene = self.scene(scene_name)
        assets = [] if scene is None else [asset for asset in scene.assets if not slash or asset.name == asset_name]
        if scene is None or (slash and not assets):
            text = f"no layer {quote(name)}; GetCapabilities lists the layers"
            raise ServiceException("UnknownLayer", text, name) if info else invalid("layers", text)
        return scene, assets

    def _check_lod(self, text: str, assets: Sequence[AssetLayer]) -> str | None:
        """Returns the number of a level of detail, None for an empty one."""
        if not text:
            return None
        scheme, _, lod = text.partition(":")
        known = {lod for scene in self.scenes for lod in scene.lods}
        if scheme != LOD_SCHEME or lod not in known:
            raise ServiceException("LODNotDefined", f"no level of detail {quote(text)}; GetCapabilities lists them", text)
        if not any(asset.summary.lods for asset in assets):
            raise ServiceException("LODNotApplicable", f"the layer has no levels of detail, but {quote(text)} was requested", text)
        return lod


class ContentsReader:
    """Reads the contents from the catalogue; keeps what it read of a scene until the scene changes. Threads may share it."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue) -> None:
        self._workspace, self._catalogue = workspace, catalogue
        self._lock = Lock()
        self._known: OrderedDict[tuple[str, str], SceneLayer] = OrderedDict()

    def read(self) -> Contents:
        layers = (self._layer(record) for record in self._catalogue.scenes() if record.built is not None and record.origin is not None)
        return Contents([layer for layer in layers if layer is not None])

    def version(self, scene: str) -> str | None:
        """Returns the version of a scene now, None if it is not built."""
        return self._version(self._catalogue.scene(scene))

    def _version(self, record: SceneRecord) -> str | None:
        """Returns a value that differs after each build: the digest of what was built, and the state of the file that a build writes last."""
        try:
            stat = (self._workspace.scene_folder(record.name) / "scene.json").stat()
        except FileNotFoundError:
            return None
        texts = [record.built, record.title, record.attribution, record.crs and record.crs.wkt, record.origin, stat.st_mtime_ns, stat.st_size]
        return hashlib.sha256(json.dumps(texts).encode()).hexdigest()[:32]

    def _layer(self, record: SceneRecord) -> SceneLayer | None:
        """Returns None for a scene whose files are missing."""
        with scene_in_use(self._workspace, record):
            version = self._version(record)
            if version is None:
                return None
            with self._lock:
                known = self._known.get((record.name, version))
            if known is None:
                known = self._read_layer(record, version)
                with self._lock:
                    self._known[(record.name, version)] = known
                    if len(self._known) > _KEPT_SCENES:
                        self._known.popitem(last=False)
            return known

    def _read_layer(self, record: SceneRecord, version: str) -> SceneLayer:
        with Registry(self._workspace.registry_path(record.name)) as registry:
            summaries, greatest = registry.asset_summaries(), registry.greatest_id()
        sources = {asset.name: asset.source for asset in self._catalogue.assets(record.name)}
        names = [name for name in summaries if not name.startswith("_")]
        assets = [AssetLayer(record.name, name, sources.get(name, name).rsplit("/", 1)[-1], summaries[name]) for name in sorted(names)]
        extent = None
        for summary in summaries.values():
            extent = unite_boxes(extent, summary.box)
        return SceneLayer(record, version, tuple(assets), greatest, extent)
