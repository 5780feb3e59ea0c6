"""Names of streets."""

from map3d_town.seeds import rng

FIRST = (
    "Linden", "Kirch", "Markt", "Garten", "Mühl", "Rosen", "Bahnhof", "Schul", "Wein", "Berg", "Brunnen", "Eichen", "Fischer",
    "Gerber", "Hafen", "Kloster", "Korn", "Neu", "Ober", "Post", "Ring", "Salz", "Schmied", "Sonnen", "Tal", "Turm", "Ufer",
    "Wald", "Weber", "Ziegel", "Birken", "Amsel", "Burg", "Färber", "Hirsch", "Ahorn", "Lerchen", "Apfel", "Bach", "Stein",
)  # fmt: skip
LAST = ("straße", "gasse", "weg", "platz", "allee", "graben")
VIAE = ("Via Appia", "Via Flaminia", "Via Aurelia", "Via Cassia", "Via Latina", "Via Salaria", "Via Ostiensis", "Via Sacra")


def street_name(seed: int, number: int) -> str:
    """Returns the name of a street; equal arguments give equal names."""
    source = rng(seed, "street", number)
    return FIRST[int(source.integers(len(FIRST)))] + LAST[int(source.choice(len(LAST), p=[0.42, 0.22, 0.2, 0.04, 0.06, 0.06]))]
