"""Plans a town: streets, blocks, outlines and roof profiles of buildings, trees, ground."""
