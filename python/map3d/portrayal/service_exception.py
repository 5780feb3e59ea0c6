"""Exceptions that clients of the 3D Portrayal Service receive (OGC 15-001r4 Tables 25 and 58, OWS Common 2.0 Tables 27 and 28)."""

from typing import Final

from map3d.errors import BadRequest

STATUS: Final = {
    "OperationNotSupported": 501,
    "OptionNotSupported": 501,
    "NoApplicableCode": 500,
    "MissingParameterValue": 400,
    "InvalidParameterValue": 400,
    "VersionNegotiationFailed": 400,
    "InvalidUpdateSequence": 400,
    "StyleNotDefined": 400,
    "BackgroundNotDefined": 400,
    "DeliveryOptionNotDefined": 400,
    "LODNotDefined": 400,
    "LODNotApplicable": 400,
    "CRSNotSupported": 400,
    "UnknownLayer": 400,
    "FormatNotSupported": 400,
    "ExceptionNotSupported": 400,
}
"""exceptionCode → HTTP status. The standard states no status for its own codes; all of them are the client's mistakes."""

MAX_TEXT: Final = 500
BUSY_RETRY_S: Final = 5


class ServiceException(BadRequest):
    """A request that the service answers with an exception report. `locator`: the parameter, or the name that the tables demand."""

    def __init__(self, code: str, text: str, locator: str | None = None, *, status: int | None = None, retry_after_s: int | None = None) -> None:
        super().__init__(text[:MAX_TEXT])
        self.code = code
        self.locator = None if locator is None else locator[:MAX_TEXT]
        self.status = STATUS[code] if status is None else status
        self.retry_after_s = retry_after_s


def missing(name: str) -> ServiceException:
    return ServiceException("MissingParameterValue", f"missing parameter {name}", name)


def invalid(name: str, text: str) -> ServiceException:
    return ServiceException("InvalidParameterValue", f"{name}: {text}", name)


def busy(text: str) -> ServiceException:
    return ServiceException("NoApplicableCode", text, status=503, retry_after_s=BUSY_RETRY_S)


def quote(value: str) -> str:
    """Returns a client's text for a message: quoted, printable, and cut."""
    return ascii(value[:64])
