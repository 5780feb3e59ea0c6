"""Draws textures from facade designs and noise."""
