"""Leases one job and commits a response that was rendered before: `python -m tests.faults.commit_one WORKSPACE RESPONSE`.

Exits with status 3 and the message when the commit fails with an error of map3d.
"""

import pickle
import sys
from pathlib import Path

from map3d.catalogue import Workspace
from map3d.errors import Map3dError
from map3d.renderings.render_task import RenderTask
from tests.faults.street import RENDERING

WORKER = "commit-one"


def main(root: Path, response: Path) -> int:
    workspace = Workspace(root)
    try:
        catalogue = workspace.open_catalogue()
        task = RenderTask(workspace, catalogue.rendering(RENDERING))
        lease = catalogue.lease(RENDERING, WORKER)
        assert lease is not None
        catalogue.heartbeat(lease)
        catalogue.done(lease, task.commit(lease, pickle.loads(response.read_bytes())))
        task.close()
        catalogue.close()
    except Map3dError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
