"""Tables of registry.sqlite.

`object.id` is AUTOINCREMENT: an id that was ever given is never given again. An object is known again by asset, name and, where a source uses a name
more than once, by which of them it is. Objects that a re-import no longer has stay, with present = 0, so that they get their id back if they return.
"""

from typing import Final

VERSION: Final = 1
MAX_ID: Final = 0xFFFFFFFF

SCHEMA: Final = """
CREATE TABLE object(id INTEGER PRIMARY KEY AUTOINCREMENT, asset TEXT NOT NULL, name TEXT NOT NULL, occurrence INTEGER NOT NULL,
  class TEXT NOT NULL, parent INTEGER, lod TEXT, attributes TEXT NOT NULL, present INTEGER NOT NULL,
  x0 REAL, y0 REAL, z0 REAL, x1 REAL, y1 REAL, z1 REAL, UNIQUE(asset, name, occurrence));
CREATE INDEX object_asset ON object(asset, present)
"""
