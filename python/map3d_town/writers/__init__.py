"""Writers of CityGML, OBJ and GeoTIFF files."""
