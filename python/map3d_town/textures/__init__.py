"""Textures, drawn from designs and noise."""
