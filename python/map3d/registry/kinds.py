"""Words by which people look for a kind of object: decoded functions, and what they are called in English, German and French."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from map3d.registry.words import search_words

_ATTRIBUTES: Final = ("function", "usage", "class")
"""Attributes that hold decoded kinds."""
_WORDS: Final = re.compile(r"[^\W\d_]{3}")
"""Text that is not a code."""
_CLASSES: Final = {"bridge": "bridge Brücke pont", "tunnel": "tunnel", "water_body": "water Gewässer eau"}
"""Classes that people look for. Most objects are buildings and trees, so that a search for those finds nothing in particular."""

_KINDS: Final = (
    ("kirche kirchen gotteshaus", "church eglise", "church Kirche église"),
    ("kapelle", "chapel chapelle", "chapel Kapelle chapelle"),
    ("synagoge", "synagogue", "synagogue Synagoge"),
    ("moschee", "mosque mosquee", "mosque Moschee mosquée"),
    ("kloster", "monastery monastere", "monastery Kloster monastère"),
    ("schule schul", "school ecole", "school Schule école"),
    ("hochschule universitat", "university universite", "university Universität université"),
    ("kindergarten kindertagesstatte kinderkrippe", "maternelle", "kindergarten maternelle"),
    ("rathaus", "townhall mairie", "town hall Rathaus mairie"),
    ("krankenhaus klinik", "hospital hopital", "hospital Krankenhaus hôpital"),
    ("bahnhof", "gare railway", "station Bahnhof gare"),
    ("museum", "musee", "museum musée"),
    ("theater", "theatre", "theatre theater"),
    ("schloss", "palace chateau", "palace Schloss château"),
    ("", "castle burg", "castle Burg château"),
    ("turm", "tower tour", "tower Turm tour"),
    ("hotel", "", "hotel"),
    ("bibliothek bucherei", "library bibliotheque", "library Bibliothek bibliothèque"),
    ("feuerwehr", "fire pompiers", "fire Feuerwehr pompiers"),
    ("polizei", "police", "police Polizei"),
    ("fabrik", "factory usine", "factory Fabrik usine"),
    ("parkhaus", "garage parking", "garage parking Parkhaus"),
    ("stadion", "stadium stade", "stadium Stadion stade"),
    ("sporthalle turnhalle", "gym gymnase", "gym Sporthalle gymnase"),
    ("schwimmbad hallenbad", "pool piscine", "pool Schwimmbad piscine"),
    ("bauernhof", "farm ferme", "farm Bauernhof ferme"),
)
"""For each kind: German words that begin or end a compound, as in `Grundschule` and `Schulgebäude`; other words that mean it; its names."""


@dataclass(frozen=True)
class _Kind:
    compounds: tuple[str, ...]
    names: list[str]
    words: frozenset[str]

    def includes(self, word: str) -> bool:
        return word in self.words or word.removesuffix("s") in self.words or word.startswith(self.compounds) or word.endswith(self.compounds)


def _read_kind(compounds: str, others: str, names: str) -> _Kind:
    return _Kind(tuple(compounds.split()), search_words(names), frozenset(others.split()))


_ROWS: Final = [_read_kind(*row) for row in _KINDS]


def decoded_kind(attributes: Mapping[str, object]) -> str:
    """Returns the first decoded function of an object; empty if there is none."""
    return next(iter(_decoded(attributes)), "")


def kind_words(kind: str, attributes: Mapping[str, object]) -> list[str]:
    """Returns the words by which an object of a class is found: its decoded functions and their names in three languages."""
    decoded = [word for text in _decoded(attributes) for word in search_words(text)]
    names = [name for row in _ROWS if any(map(row.includes, decoded)) for name in row.names]
    return [*decoded, *names, *search_words(_CLASSES.get(kind, ""))]


def _decoded(attributes: Mapping[str, object]) -> list[str]:
    values = (attributes.get(name) for name in _ATTRIBUTES)
    return [value.strip() for value in values if isinstance(value, str) and _WORDS.search(value)]
