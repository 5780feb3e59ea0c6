"""The registry of a scene: its objects with their ids and attributes (spec/glossary.md, spec/manifest.md)."""

from map3d.registry.registered_objects import NewObject, ObjectKind, RegisteredAsset, RegisteredObject
from map3d.registry.registry import Registry

__all__ = ["NewObject", "ObjectKind", "RegisteredAsset", "RegisteredObject", "Registry"]
