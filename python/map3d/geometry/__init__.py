"""Frames of views and renderings (spec/pyramid.md §1–3). Pure arithmetic: no I/O."""
