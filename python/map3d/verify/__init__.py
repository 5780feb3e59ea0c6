"""Verification: recomputes and compares everything stored, for scenes, renderings and published folders."""
