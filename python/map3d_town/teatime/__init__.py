"""The teatime scene: a green teapot at the origin and a green cube next to it."""

from map3d_town.teatime.teatime_scene import write_teatime

__all__ = ["write_teatime"]
