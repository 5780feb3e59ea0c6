"""Renderings: creating and planning them, estimating and building what they need, rendering one block, writing the manifest."""
