"""The service's front door: takes a request as bytes and returns the answer, computed in other threads and processes where it takes long."""

import contextlib
import hashlib
import json
import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final

from map3d.catalogue import Workspace
from map3d.cores import usable_cores
from map3d.errors import Map3dError
from map3d.portrayal.answers import REVALIDATE, Answer
from map3d.portrayal.capabilities import Flavour, ServiceContents, capabilities, parse_get_capabilities
from map3d.portrayal.capabilities_operations import INFO_OPERATIONS
from map3d.portrayal.contents import Contents, ContentsReader
from map3d.portrayal.exception_report import INFO_FORMS, VIEW_FORMS, XML, exception_form, image_report, report
from map3d.portrayal.feature_documents import feature_document
from map3d.portrayal.feature_info import Feature, FeatureInfo, check_found
from map3d.portrayal.kvp import parse_query
from map3d.portrayal.parameters import Parameters
from map3d.portrayal.pyramid_views import PyramidViews
from map3d.portrayal.request_readers import RequestReaders
from map3d.portrayal.requests import (
    check_service,
    check_version,
    parse_get_view,
    parse_info_by_object_id,
    parse_info_by_position,
    parse_info_by_ray,
)
from map3d.portrayal.resources import Resources
from map3d.portrayal.service_exception import ServiceException, busy, quote
from map3d.portrayal.service_state import ServiceState
from map3d.portrayal.tracer_pool import QUEUE, SUBPROCESSES, TracerPool
from map3d.portrayal.views import ViewService
from map3d.portrayal.xml_requests import OPERATIONS, parse_body
from map3d.renderings.view_store import ViewStore, store_limit_bytes, views_folder

FOLDER: Final = "portrayal"
log: Final = logging.getLogger("map3d.portrayal")


@dataclass(frozen=True)
class ServiceRequest:
    """`body`: None for GET; `endpoint`: absolute URL of the service, for the capabilities; `strict`: the flavour of their schema."""

    query: bytes
    body: bytes | None
    endpoint: str
    strict: bool = False

    @property
    def text(self) -> bytes:
        """The part of the request that determines the views in the answer."""
        return self.query if self.body is None else self.body


@dataclass(frozen=True)
class _Waiting:
    """A request that waits for its answer."""

    request: ServiceRequest
    parameters: Parameters
    answer: "Future[Answer]"


@dataclass
class _Computation:
    """A computation that one or more identical requests wait for."""

    waiting: list[_Waiting]


@dataclass(frozen=True)
class _Pending:
    """An answer that takes long. Requests with equal keys have equal answers."""

    key: str
    compute: Callable[[], Answer]


class PortrayalService:
    """One per process; threads may share it."""

    def __init__(self, workspace: Workspace, *, pool: TracerPool | None = None, limit_bytes: int | None = None, wait_s: float | None = None) -> None:
        """`wait_s`: how long a request may wait for the catalogue, by default as long as a restart of it takes."""
        folder = workspace.root / FOLDER
        self._catalogue = workspace.open_catalogue(wait_s=wait_s)
        self._contents = ContentsReader(workspace, self._catalogue)
        self._state = ServiceState(folder / "service.sqlite")
        self._store = ViewStore(views_folder(workspace), store_limit_bytes() if limit_bytes is None else limit_bytes)
        self._store.keep_scenes([scene.name for scene in self._catalogue.scenes()])
        self.pool = TracerPool(subprocesses=min(SUBPROCESSES, usable_cores())) if pool is None else pool
        pyramids = PyramidViews(workspace, self._catalogue)
        self.views = ViewService(workspace, self._contents, self._state, self._store, pyramids, self.pool)
        self._info = FeatureInfo(workspace, self.views)
        self._resources = Resources(workspace, self._catalogue)
        self._readers = RequestReaders(self._is_full)
        self._limit = QUEUE + SUBPROCESSES
        self._computing = ThreadPoolExecutor(self._limit, thread_name_prefix="portrayal-views")
        self._lock = threading.Lock()
        self._computations: dict[str, _Computation] = {}

    def submit(self, request: ServiceRequest) -> "Future[Answer]":
        """Returns the future answer. It never fails: errors are answers, in XML for a request that is refused unread."""
        answer: Future[Answer] = Future()
        if not self._readers.submit(request.text, lambda: self._start(request, answer)):
            answer.set_result(_explain(self._busy(), Parameters()))
        return answer

    def answer(self, request: ServiceRequest) -> Answer:
        return self.submit(request).result()

    def close(self) -> None:
        self._readers.close()
        self.pool.close()
        self._computing.shutdown(cancel_futures=True)
        self._state.close()
        self._store.close()
        self._catalogue.close()

    def _is_full(self) -> bool:
        return len(self._computations) >= self._limit

    def _busy(self) -> ServiceException:
        return busy(f"{self._limit} requests are being computed, which is the limit; try again later")

    def _start(self, request: ServiceRequest, answer: "Future[Answer]") -> None:
        parameters = Parameters()
        try:
            parameters = parse_query(request.query) if request.body is None else parse_body(request.body)
            found = self._handle(request, parameters)
            if isinstance(found, Answer):
                self._readers.remember(request.text)
                answer.set_result(found)
            else:
                self._wait(found, _Waiting(request, parameters, answer))
        except BaseException as error:
            answer.set_result(_explain(error, parameters))

    def _wait(self, pending: _Pending, waiting: _Waiting) -> None:
        """Joins a computation with the same key, or starts one. Raises ServiceException when too many are under way."""
        with self._lock:
            known = self._computations.get(pending.key)
            if known is not None:
                known.waiting.append(waiting)
                return
            if self._is_full():
                raise self._busy()
            self._computations[pending.key] = _Computation([waiting])
        self._computing.submit(self._compute, pending)

    def _compute(self, pending: _Pending) -> None:
        result: Answer | BaseException
        try:
            result = pending.compute()
        except BaseException as error:
            result = error
        with self._lock:
            waiting = self._computations.pop(pending.key).waiting
        for one in waiting:
            if isinstance(result, Answer):
                self._readers.remember(one.request.text)
            with contextlib.suppress(Exception):
                one.answer.set_result(result if isinstance(result, Answer) else _explain(result, one.parameters))

    def _handle(self, request: ServiceRequest, parameters: Parameters) -> Answer | _Pending:
        operation = _operation(parameters)
        check_service(parameters)
        if operation == "GetCapabilities":
            return self._get_capabilities(request, parameters)
        check_version(parameters)
        exception_form(parameters, VIEW_FORMS if operation == "GetView" else INFO_FORMS)
        if operation == "GetView":
            return self._get_view(parameters)
        if operation == "GetResourceById":
            return self._resources.get(parameters)
        return self._get_info(operation, parameters)

    def _read_contents(self) -> Contents:
        """Returns the layers, and makes sure that their objects have ids."""
        contents = self._contents.read()
        for scene in contents.scenes:
            self._state.pages(scene.identifier, scene.greatest_id)
        return contents

    def _get_capabilities(self, request: ServiceRequest, parameters: Parameters) -> Answer:
        wanted = parse_get_capabilities(parameters)
        contents = self._read_contents()
        renderings = self._resources.renderings()
        sequence = self._state.sequence(hashlib.sha256(json.dumps([contents.version, renderings]).encode()).hexdigest()[:32])
        document = capabilities(wanted, ServiceContents(contents, renderings, sequence, request.endpoint), Flavour(request.strict))
        return Answer(200, "text/xml", document, REVALIDATE)

    def _get_view(self, parameters: Parameters) -> Answer | _Pending:
        planned = self.views.plan(parse_get_view(parameters), self._read_contents())
        stored = self.views.find_stored(planned)
        if stored is not None:
            return stored
        key = "".join(key for view in planned for key in view.keys)
        return _Pending(f"view:{key}", lambda: self.views.compute(planned))

    def _get_info(self, operation: str, parameters: Parameters) -> Answer | _Pending:
        contents = self._read_contents()
        find: Callable[[], list[Feature]]
        wanted: Any
        if operation == "GetFeatureInfoByObjectId":
            wanted = parse_info_by_object_id(parameters)
            features = self._info.by_object_id(wanted, contents)
            check_found(features, wanted)
            return Answer(200, wanted.format, feature_document(features, wanted.format, wanted.id_only), REVALIDATE)
        if operation == "GetFeatureInfoByRay":
            wanted = ray = parse_info_by_ray(parameters)
            find = lambda: self._info.by_ray(ray, contents)  # noqa: E731 - the value of a request
        else:
            wanted = position = parse_info_by_position(parameters)
            find = lambda: self._info.by_position(position, contents)  # noqa: E731
        key = f"{operation}:{contents.version}:{wanted!r}"
        return _Pending(key, lambda: Answer(200, wanted.format, feature_document(find(), wanted.format, wanted.id_only), REVALIDATE))


def _operation(parameters: Parameters) -> str:
    """Returns the operation's name. Raises MissingParameterValue, OperationNotSupported."""
    text = parameters.require("request")
    name = next((one for one in OPERATIONS if one.lower() == text.lower()), None)
    if name is None:
        raise ServiceException("OperationNotSupported", f"no operation {quote(text)}; expected {', '.join(OPERATIONS)}", text)
    return name


def _explain(error: BaseException, parameters: Parameters) -> Answer:
    """Returns the answer to a request that failed, in the form that it asks for."""
    known = _service_exception(error)
    form = XML
    with contextlib.suppress(ServiceException):
        allowed = INFO_FORMS if (parameters.get("request") or "").lower() in [name.lower() for name in INFO_OPERATIONS] else VIEW_FORMS
        form = exception_form(parameters, allowed)
    if form != XML:
        with contextlib.suppress(Exception):
            return image_report(known, parameters, form)
    return report(known)


def _service_exception(error: BaseException) -> ServiceException:
    if isinstance(error, ServiceException):
        return error
    log.error("%s", error, exc_info=not isinstance(error, Map3dError))
    return ServiceException("NoApplicableCode", "the service failed; see the server log")
