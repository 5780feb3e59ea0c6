"""Renders blocks when their tiles are requested, within a quota of stored blocks."""
