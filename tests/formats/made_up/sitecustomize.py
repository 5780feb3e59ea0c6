"""Adds the row of the made-up format: Python imports this module when it starts, in every process of a test."""

from box_format import BOXES

import map3d.formats

map3d.formats.FORMATS = (*map3d.formats.FORMATS, BOXES)
