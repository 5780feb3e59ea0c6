"""Import of elevation models and orthophotos as textured ground."""
