"""The files are valid CityGML 2.0; the schemas are in the folder `standards` next to MAP3D_DATA."""

import os
from pathlib import Path

import pytest

DATA = os.environ.get("MAP3D_DATA")
MODULES = ("building", "appearance", "generics", "vegetation")


@pytest.mark.skipif(not DATA, reason="set MAP3D_DATA for the CityGML schemas")
def test_citygml_is_valid(either: Path) -> None:
    etree = pytest.importorskip("lxml.etree")
    home = Path(str(DATA)).resolve().parent / "standards" / "citygml"

    class Catalogue(etree.Resolver):  # type: ignore[misc, name-defined]
        def resolve(self, url: str, public: str, context: object) -> object:
            path = home / url.partition("schemas.opengis.net/")[2]
            if "schemas.opengis.net/" in url and path.is_file():
                return self.resolve_filename(str(path), context)
            if "xlink" in url and url.startswith("http"):
                return self.resolve_filename(str(home / "xlink" / "1.0.0" / "xlinks.xsd"), context)
            return None

    parser = etree.XMLParser(no_network=True)
    parser.resolvers.add(Catalogue())
    imports = "".join(f'<xs:import namespace="http://www.opengis.net/citygml/{m}/2.0" schemaLocation="{home}/citygml/2.0/{m}.xsd"/>' for m in MODULES)
    schema = etree.XMLSchema(etree.fromstring(f'<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema">{imports}</xs:schema>', parser))
    for path in sorted((either / "citygml").glob("*.gml")):
        assert schema.validate(etree.parse(str(path))), f"{path.name}: {schema.error_log.last_error}"
