"""The tea time scene: a green teapot on the origin and a green cube beside it."""

from map3d_town.teatime.teatime_scene import write_teatime

__all__ = ["write_teatime"]
