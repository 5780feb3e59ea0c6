"""A rendering as one folder of static files, to copy anywhere."""

from map3d.publish.publish_folder import Published, publish

__all__ = ["Published", "publish"]
