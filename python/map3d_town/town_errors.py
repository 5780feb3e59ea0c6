"""Errors of the town generator."""


class TownError(Exception):
    """The town cannot be generated. The message says what, where and what to do."""
