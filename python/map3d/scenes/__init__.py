"""Scenes: built from their files, shared with other nodes, cached there, and what they hold."""
