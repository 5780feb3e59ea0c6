"""Import of source documents as assets of a scene."""
