"""Parameters of a request as text, the same from key-value pairs and from XML."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from map3d.portrayal.service_exception import missing

PortrayalText = Mapping[str, list[str]]
"""The parts of a portrayal by lower-case name: width, height, projection (identifier, then values), imagelayers, formats, qualities."""


@dataclass(frozen=True)
class Parameters:
    """`values`: decoded, by lower-case name. `portrayals`: None if the parameter is missing."""

    values: Mapping[str, str] = field(default_factory=dict)
    portrayals: tuple[PortrayalText, ...] | None = None

    def get(self, name: str) -> str | None:
        """Returns the value without surrounding blanks; None if it is missing. `name` as the standard writes it."""
        value = self.values.get(name.lower())
        return None if value is None else value.strip()

    def non_empty(self, name: str) -> str | None:
        return self.get(name) or None

    def require(self, name: str) -> str:
        """Returns a value that is not empty. Raises MissingParameterValue."""
        value = self.get(name)
        if not value:
            raise missing(name)
        return value
