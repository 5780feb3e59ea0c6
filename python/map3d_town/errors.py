"""What can go wrong while a town is made."""


class TownError(Exception):
    """A town cannot be made; the message says what, where and what to do."""
