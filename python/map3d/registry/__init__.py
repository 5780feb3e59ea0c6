"""The registry: the objects of a scene, their ids and attributes (spec/glossary.md, spec/manifest.md)."""

from map3d.registry.objects import NewObject, RegisteredObject
from map3d.registry.registry import Registry

__all__ = ["NewObject", "RegisteredObject", "Registry"]
