"""`python -m map3d.operations FOLDER IDENTITY_FILE PARENT_PID`: the operation worker of a server. Only `WorkerProcess` starts it."""

import os
import sys
from pathlib import Path

from map3d.catalogue import Workspace
from map3d.errors import Map3dError
from map3d.operations.operation_worker import OperationWorker
from map3d.operations.worker_process import write_identity
from map3d.subprocess.limits import die_with_parent


def main() -> None:
    folder, identity_path, parent_pid = sys.argv[1:4]
    die_with_parent(int(parent_pid))
    workspace = Workspace(Path(folder))
    try:
        catalogue = workspace.open_catalogue()
    except Map3dError as error:
        sys.exit(f"map3d: {error}")
    try:
        write_identity(Path(identity_path))
        OperationWorker(workspace, catalogue, on_operation=_print).run()
    finally:
        catalogue.close()


def _print(line: str) -> None:
    sys.stderr.write(f"map3d: {line}\n")
    sys.stderr.flush()


if __name__ == "__main__":
    os.nice(5)
    main()
