"""A rendering as static files: in a folder, to copy anywhere, or in an object store."""

from map3d.publish.publish_rendering import Published, publish

__all__ = ["Published", "publish"]
