"""From files to a click in a real browser."""
