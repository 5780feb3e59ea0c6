"""The plan of a town: streets, blocks, buildings as outlines with profiles, trees, ground."""
