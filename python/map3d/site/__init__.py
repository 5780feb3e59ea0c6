"""Site: a folder of files becomes a scene and a rendering, with a report."""
