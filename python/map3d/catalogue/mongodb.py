"""The catalogue in a MongoDB database: scenes, assets, renderings. Jobs, operations and accounts are in files of their own.

Records are stored as in SQLite, with nested values as JSON text. A change of a record is repeated if another process changed the record meanwhile.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, Self

from map3d.catalogue import codec
from map3d.catalogue.contract import LEASE_S
from map3d.catalogue.mongodb_accounts import MongoAccounts
from map3d.catalogue.mongodb_connection import WAIT_S, Document, MongoConnection
from map3d.catalogue.mongodb_documents import new_call
from map3d.catalogue.mongodb_operations import MongoOperations
from map3d.catalogue.records import AssetRecord, RenderingRecord, SceneCrs, SceneRecord
from map3d.errors import AlreadyExists, BadRequest, NotFound
from map3d.geometry.frames import PinnedFrame
from map3d.types import Layer, Vec3, check_name

_RENDERING: Final = (
    "name",
    "scene",
    "title",
    "attribution",
    "res_m",
    "passes",
    "frames",
    "box",
    "options",
    "content_version",
    "announced_version",
    "planning",
)
"""The order of `codec.dump_rendering`."""


class MongoCatalogue(MongoOperations, MongoAccounts):
    """Implements `Catalogue` in the database that the URL names; creates collections and indexes when they do not exist."""

    def __init__(self, url: str, *, lease_s: float = LEASE_S, wait_s: float | None = None) -> None:
        super().__init__(MongoConnection(url, WAIT_S if wait_s is None else wait_s), lease_s)

    def close(self) -> None:
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- scenes and assets ------------------------------------------------------------------------------------------------------

    def create_scene(self, scene: SceneRecord) -> None:
        check_name(scene.name, "scene")
        document = {
            "_id": scene.name,
            "name": scene.name,
            "title": scene.title,
            "attribution": scene.attribution,
            "crs": codec.dump_crs(scene.crs),
            "origin": codec.dump_or_none(scene.origin),
            "options": json.dumps(dict(scene.options)),
            "built": scene.built,
            "call": new_call(),
        }
        if not self._connection.insert("scene", document):
            raise AlreadyExists(f"scene {scene.name}: exists already; choose another name, or add files to it with map3d add-files")

    def scene(self, name: str) -> SceneRecord:
        return codec.load_scene(self._record("scene", name))

    def scenes(self) -> list[SceneRecord]:
        return [codec.load_scene(document) for document in self._find("scene", {})]

    def pin_scene(self, name: str, crs: SceneCrs | None = None, origin: Vec3 | None = None) -> SceneRecord:
        while True:
            document = self._record("scene", name)
            pinned = codec.pinned(codec.load_scene(document), crs, origin, empty=not self._find("asset", {"scene": name}, limit=1))
            values = {"crs": codec.dump_crs(pinned.crs), "origin": codec.dump_or_none(pinned.origin)}
            before = {field: document[field] for field in values}
            if before == values or self._update_many({"_id": name, **before}, {"$set": values}, "scene"):
                return pinned

    def set_built(self, name: str, digest: str) -> None:
        self._update_many({"_id": name}, {"$set": {"built": digest}}, "scene")

    def set_scene_options(self, name: str, options: Mapping[str, Any]) -> None:
        self._record("scene", name)
        self._update_many({"_id": name}, {"$set": {"options": json.dumps(dict(options))}}, "scene")

    def put_asset(self, asset: AssetRecord) -> None:
        check_name(asset.name, "asset")
        self._record("scene", asset.scene)
        names = ("scene", "name", "source", "format", "digest", "source_digest")
        document = {name: getattr(asset, name) for name in names} | {"report": json.dumps(dict(asset.report))}
        place = {"_id": f"{asset.scene} {asset.name}"}
        self._connection.run(lambda _: self._connection.collection("asset").replace_one(place, place | document, upsert=True))

    def assets(self, scene: str) -> list[AssetRecord]:
        self._record("scene", scene)
        return [codec.load_asset(document) for document in self._find("asset", {"scene": scene})]

    def remove_asset(self, scene: str, name: str) -> None:
        self._record("scene", scene)
        place = {"_id": f"{scene} {name}"}
        if self._find("asset", place, {"_id": 1}):
            self._delete("asset", place)
        else:
            names = [document["name"] for document in self._find("asset", {"scene": scene}, limit=21)]
            raise NotFound(f"scene {scene}: no asset {name!r}; existing assets: {codec.list_names(names)}")

    def remove_scene(self, name: str) -> None:
        self._record("scene", name)
        renderings = [document["name"] for document in self._find("rendering", {"scene": name}, {"name": 1})]
        if renderings:
            raise BadRequest(f"scene {name}: has renderings ({', '.join(renderings)}); remove them first with map3d remove-rendering")
        self._delete("asset", {"scene": name})
        self._delete("scene", {"_id": name})

    # -- renderings -------------------------------------------------------------------------------------------------------------

    def create_rendering(self, rendering: RenderingRecord) -> None:
        check_name(rendering.name, "rendering")
        self._record("scene", rendering.scene)
        removed = self._find("removed_rendering", {"_id": rendering.name})
        version = max(rendering.content_version, removed[0]["content_version"] + 1 if removed else 0)
        document = {"_id": rendering.name, **_dump(replace(rendering, content_version=version)), "call": new_call()}
        if not self._connection.insert("rendering", document):
            raise AlreadyExists(f"rendering {rendering.name}: exists already; choose another name, or use --regrid to replace its frames")

    def rendering(self, name: str) -> RenderingRecord:
        return codec.load_rendering(self._record("rendering", name))

    def renderings(self, scene: str | None = None) -> list[RenderingRecord]:
        query = {} if scene is None else {"scene": scene}
        return [codec.load_rendering(document) for document in self._find("rendering", query)]

    def regrid(self, rendering: RenderingRecord) -> RenderingRecord:
        """Increments the version before it removes the jobs: after a kill, new jobs of the old frames already have greater fences."""
        before = self.rendering(rendering.name)
        self._update_many(_at_version(before), {"$set": {"content_version": before.content_version + 1}}, "rendering")
        self._delete("job", {"rendering": rendering.name})
        after = codec.with_versions(rendering, before.content_version + 1, before.announced_version)
        fields = {name: value for name, value in _dump(after).items() if name not in ("content_version", "announced_version")}
        self._update_many({"_id": rendering.name}, {"$set": fields}, "rendering")
        return self.rendering(rendering.name)

    def add_frames(self, name: str, frames: Sequence[PinnedFrame]) -> RenderingRecord:
        def change(before: RenderingRecord) -> RenderingRecord:
            if duplicates := {frame.id for frame in before.frames} & {frame.id for frame in frames}:
                raise AlreadyExists(f"rendering {name}: view {', '.join(sorted(duplicates))} exists already")
            return replace(before, frames=(*before.frames, *frames))

        return self._change(name, "frames", change)

    def add_pass(self, name: str, layers: Sequence[Layer]) -> RenderingRecord:
        def change(before: RenderingRecord) -> RenderingRecord:
            if duplicates := {layer.name for layer in before.layers} & {layer.name for layer in layers}:
                raise AlreadyExists(f"rendering {name}: layer {', '.join(sorted(duplicates))} exists already")
            return replace(before, passes=(*before.passes, tuple(layers)))

        return self._change(name, "passes", change)

    def describe_rendering(self, name: str, title: str, attribution: str, options: Mapping[str, Any]) -> RenderingRecord:
        after = _dump(replace(self.rendering(name), title=title, attribution=attribution, options=options))
        self._update_many({"_id": name}, {"$set": {field: after[field] for field in ("title", "attribution", "options")}}, "rendering")
        return self.rendering(name)

    def announce(self, name: str, version: int) -> None:
        self._update_many({"_id": name}, {"$max": {"announced_version": version}}, "rendering")

    def remove_rendering(self, name: str) -> None:
        """Removes jobs once more at the end, since a plan that ran meanwhile may have added some."""
        version = self.rendering(name).content_version
        removed = self._connection.collection("removed_rendering")
        self._connection.run(lambda _: removed.update_one({"_id": name}, {"$max": {"content_version": version}}, upsert=True))
        self._delete("job", {"rendering": name})
        self._delete("rendering", {"_id": name})
        self._delete("job", {"rendering": name})

    # -- documents --------------------------------------------------------------------------------------------------------------

    def _record(self, collection: str, name: str) -> Document:
        """Raises NotFound, naming the existing records."""
        found = self._find(collection, {"_id": name})
        if not found:
            names = [document["_id"] for document in self._find(collection, {}, {"_id": 1}, limit=21)]
            raise NotFound(f"no {collection} {name!r}; existing {collection}s: {codec.list_names(names)}")
        return found[0]

    def _change(self, name: str, field: str, change: Callable[[RenderingRecord], RenderingRecord]) -> RenderingRecord:
        """Replaces a field of a rendering, and again if it was changed meanwhile."""
        while True:
            document = self._record("rendering", name)
            after = change(codec.load_rendering(document))
            if self._update_many({"_id": name, field: document[field]}, {"$set": {field: _dump(after)[field]}}, "rendering"):
                return after


def _dump(rendering: RenderingRecord) -> dict[str, Any]:
    return dict(zip(_RENDERING, codec.dump_rendering(rendering), strict=True))


def _at_version(rendering: RenderingRecord) -> Document:
    return {"_id": rendering.name, "content_version": rendering.content_version}
