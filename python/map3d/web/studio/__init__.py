"""The pages of the studio: scenes, files, renderings, operations, accounts."""
