"""A rendering as one folder of static files, to copy anywhere."""

from map3d.publish.folder import Published, publish
from map3d.publish.verify import verify_published

__all__ = ["Published", "publish", "verify_published"]
