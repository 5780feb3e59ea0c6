"""Tests from files to a click in a real browser."""
