"""Jobs: workers lease blocks, have them rendered in a child and commit them."""
