"""Responses to requests that fail: a page for people, and an error of the API for programs.

Layer 5.
"""

from collections.abc import Awaitable, Callable, Mapping
from http import HTTPStatus
from typing import Final

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.web import words
from urc.web.serve.replies import API, told
from urc.web.show.pages import error_page

__all__ = ["ERROR_HANDLERS"]

_PAGE: Final = {"cache-control": "no-store"}
_Handler = Callable[[Request, Exception], Awaitable[Response]]


async def _told(request: Request, error: Exception) -> Response:
    if not isinstance(error, HTTPException):
        raise error
    if request.url.path.startswith(API):
        return told(error.status_code, error.detail)
    standard = HTTPStatus(error.status_code).phrase
    text = (
        words.t("This page does not exist.")
        if error.detail == standard == "Not Found"
        else error.detail
    )
    html = error_page(request.state.nonce, error.status_code, text)
    headers = {**_PAGE, **(error.headers or {})}
    return HTMLResponse(html, status_code=error.status_code, headers=headers)


async def _broken(request: Request, _: Exception) -> Response:
    text = words.t("URC had an internal error. The server's log has the details.")
    if request.url.path.startswith(API):
        return told(500, text)
    return HTMLResponse(error_page(request.state.nonce, 500, text), 500, headers=_PAGE)


ERROR_HANDLERS: Final[Mapping[int | type[Exception], _Handler]] = {
    HTTPException: _told,
    404: _told,
    405: _told,
    Exception: _broken,
}
"""Handlers of errors by status or class, for Starlette."""
