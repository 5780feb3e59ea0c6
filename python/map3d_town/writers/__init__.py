"""Writes CityGML, OBJ and GeoTIFF files."""
