"""JSON responses of the HTTP API and the bodies of its requests.

Layer 5. Failures from routes, access control and the page policy all have the same form.
"""

from collections.abc import Awaitable, Callable
from functools import wraps
from http import HTTPStatus
from typing import Any, Concatenate, Final, ParamSpec, TypeVar

import msgspec
from starlette.requests import Request
from starlette.responses import Response

from urc.problems import UrcError

__all__ = [
    "API",
    "ApiError",
    "Endpoint",
    "Failure",
    "answer",
    "answers_errors",
    "answers_errors_with",
    "body_of",
    "told",
]

Endpoint = Callable[..., Any]

API: Final = "/api/"
"""Prefix of all HTTP API paths."""
_NO_STORE: Final = {"cache-control": "no-store"}
_JSON: Final = "application/json"
_T = TypeVar("_T")
_Self = TypeVar("_Self")
_P = ParamSpec("_P")


class Failure(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Response to a failed request."""

    code: str
    """Reason code for programs, such as ``not-found``."""
    message: str
    """Reason for human readers, in one line."""
    error: str
    """Copy of `message` for old programs, because earlier versions had only this key."""


class ApiError(Exception):
    """A failed API request, with an HTTP status, a one-line reason and a reason code."""

    def __init__(self, status: int, line: str, code: str = "") -> None:
        super().__init__(line)
        self.status = status
        self.line = line
        self.code = code


def answer(value: object, status: int = 200) -> Response:
    """Return a JSON response that must not be cached."""
    return Response(msgspec.json.encode(value), status, _NO_STORE, media_type=_JSON)


def told(status: int, line: str, code: str = "") -> Response:
    """Return the response to a failed request.

    Args:
        status: HTTP status, 400 or above.
        line: the reason, in one line.
        code: reason code; "" for the status's standard phrase.
    """
    code = code or HTTPStatus(status).phrase.lower().replace(" ", "-")
    return answer(Failure(code, line, line), status)


async def body_of(request: Request, kind: type[_T]) -> _T:
    """Return a request's JSON body, decoded as `kind`.

    Raises:
        ApiError: the body is not JSON, or does not match the type `kind`.
    """
    if request.headers.get("content-type", "").partition(";")[0].strip() != _JSON:
        raise ApiError(415, f"expected a body of type {_JSON}")
    try:
        return msgspec.json.decode(await request.body(), type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ApiError(400, f"the request body does not match the schema: {error}") from None


def answers_errors_with(
    status: int,
) -> Callable[
    [Callable[Concatenate[_Self, Request, _P], Awaitable[Response]]],
    Callable[Concatenate[_Self, Request, _P], Awaitable[Response]],
]:
    """Return a decorator that converts a handler's `ApiError` or `UrcError` to a response.

    Args:
        status: HTTP status for a `UrcError`; an `ApiError` contains its own status.
    """

    def decorate(
        handler: Callable[Concatenate[_Self, Request, _P], Awaitable[Response]],
    ) -> Callable[Concatenate[_Self, Request, _P], Awaitable[Response]]:
        @wraps(handler)
        async def handle(
            self: _Self, request: Request, /, *args: _P.args, **named: _P.kwargs
        ) -> Response:
            try:
                return await handler(self, request, *args, **named)
            except ApiError as failure:
                return told(failure.status, failure.line, failure.code)
            except UrcError as error:
                return told(status, str(error).strip().partition("\n")[0])

        return handle

    return decorate


answers_errors: Final = answers_errors_with(409)
"""Decorator for handlers that refuse requests because of the state of a robot or the server."""
