"""The uploads that operations still need."""

from typing import Final

from map3d.catalogue import Catalogue
from map3d.catalogue.operation_records import UNENDED

_MOST: Final = 100_000


def uploads_in_use(catalogue: Catalogue) -> frozenset[str]:
    """Returns the ids of uploads that waiting and running operations import."""
    operations = catalogue.operations(states=UNENDED, limit=_MOST)
    return frozenset(str(id) for operation in operations for id in operation.arguments.get("files", ()))
