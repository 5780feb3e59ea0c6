"""The public pages, and what all pages use: languages, formats, translations."""
