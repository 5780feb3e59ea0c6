"""Published folders, from the fixtures of tests/publish."""

from tests.publish.conftest import built_viewer, finished, out, workspace

__all__ = ["built_viewer", "finished", "out", "workspace"]
