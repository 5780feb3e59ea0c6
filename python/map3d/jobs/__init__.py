"""Jobs: workers lease blocks, have a subprocess render them and commit the result."""
