import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.portrayal.answers import Answer
from map3d.portrayal.service import PortrayalService, ServiceRequest
from map3d.portrayal.tracer_pool import TracerPool
from tests.portrayal.villages import make_villages

FAKE = "tests.portrayal.fake_tracer:open_fake"
ENDPOINT = "http://example.org/3dps"


@pytest.fixture(scope="session")
def villages(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """A workspace for copying: the scenes `village` and `harbour`, with a rendering each."""
    return make_villages(tmp_path_factory.mktemp("villages"))


@pytest.fixture
def workspace(villages: Workspace, tmp_path: Path) -> Workspace:
    return Workspace(Path(shutil.copytree(villages.root, tmp_path / "ws")))


@pytest.fixture
def service(workspace: Workspace) -> Iterator[PortrayalService]:
    made = PortrayalService(workspace, pool=TracerPool(entry=FAKE, subprocesses=1, deadline_s=5), limit_bytes=1 << 30)
    yield made
    made.close()


Ask = Callable[..., Answer]


@pytest.fixture
def ask(service: PortrayalService) -> Ask:
    """Asks the service: a query without the parameters that all operations share, and optionally a body."""

    def call(query: str, body: bytes | None = None, *, strict: bool = False, raw: bool = False) -> Answer:
        text = query if raw else f"service=3DPS&version=1.0&{query}"
        return service.answer(ServiceRequest(text.encode(), body, ENDPOINT, strict))

    return call
