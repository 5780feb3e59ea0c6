"""Renderings: builds the scene, creates, plans and estimates a rendering, renders its blocks and writes the manifest."""
