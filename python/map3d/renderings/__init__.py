"""Renderings: plans and estimates a rendering, renders its blocks and writes the manifest."""
