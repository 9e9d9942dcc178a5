"""The OpenAPI 3.1 document of the HTTP API, generated from the table of its calls.

Layer 5. The schemas are generated from the types that the server decodes and encodes, so the
document matches the server.
"""

import asyncio
from collections.abc import Iterable
from functools import cache
from http import HTTPStatus
from typing import Any, Final, get_args

import msgspec
from starlette.requests import Request
from starlette.responses import Response

from urc import __version__
from urc.web.api.calls import CALLS, JSON, Call
from urc.web.api.field_texts import field_texts
from urc.web.serve.replies import Failure
from urc.web.serve.rights import Right

__all__ = ["DOCUMENT", "api_document", "document"]

DOCUMENT: Final = "/api/v1/openapi.json"
_SCHEMES: Final = {
    "token": {
        "type": "http",
        "scheme": "bearer",
        "description": "The token of a program, or the start key that URC prints.",
    },
    "cookie": {
        "type": "apiKey",
        "in": "cookie",
        "name": "urc-sign-in",
        "description": "The sign-in cookie of a browser; its name ends with an identifier."
        " A request that changes data also needs an Origin header that names this server.",
    },
}
_ABOUT: Final = (
    "Programs send `Authorization: Bearer TOKEN` with each request. Times are in seconds. The"
    " WebSocket `/ws` also streams a robot's values, and is preferable for motion."
)
_IN_PATH: Final = {
    "name": "Name of the robot, as in its document.",
    "signal": "Name of the signal.",
    "command": "Name of the command.",
    "file": "File name of the recording, as in the list of recordings.",
    "id": "Identifier of the pairing.",
}
"""Descriptions of the path parameters."""
_ALL: Final = (413, 429, 503)
"""Failure statuses of every call, for oversized requests and too many requests or connections."""


async def document(_: Request) -> Response:
    """Return the OpenAPI document as a response."""
    headers = {"cache-control": "no-store"}
    # The first call takes longer than a tick may wait.
    found = await asyncio.to_thread(api_document)
    return Response(found, media_type=JSON, headers=headers)


@cache
def api_document() -> bytes:
    """Return the OpenAPI document as JSON."""
    kinds = [kind for call in CALLS for kind in (call.answer, call.body)]
    kinds = [kind for kind in kinds if kind not in (None, bytes)]
    _, components = msgspec.json.schema_components(
        list(dict.fromkeys([*kinds, Failure])), ref_template="#/components/schemas/{name}"
    )
    messages: set[type[msgspec.Struct]] = set()
    _messages([*kinds, Failure], messages)
    for message in messages:
        _describe(components[message.__name__], message)
    paths: dict[str, dict[str, Any]] = {}
    for call in CALLS:
        paths.setdefault(call.path, {})[call.method.lower()] = _operation(call)
    found = {
        "openapi": "3.1.0",
        "info": {"title": "URC", "version": __version__, "description": _ABOUT},
        "paths": paths,
        "components": {"schemas": components, "securitySchemes": _SCHEMES},
    }
    return msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n"


def _messages(annotations: Iterable[object], found: set[type[msgspec.Struct]]) -> None:
    """Add all message types in `annotations` and in the fields of these types to `found`."""
    for one in annotations:
        if isinstance(one, type) and issubclass(one, msgspec.Struct):
            if one not in found:
                found.add(one)
                _messages((field.type for field in msgspec.structs.fields(one)), found)
        else:
            _messages(get_args(one), found)


def _describe(schema: dict[str, Any], message: type[msgspec.Struct]) -> None:
    """Add the fields' docstrings, as descriptions, to the schema of a message type."""
    texts = field_texts(message)
    for field in msgspec.structs.fields(message):
        described = schema.get("properties", {}).get(field.encode_name)
        if described is not None and field.name in texts:
            described["description"] = " ".join(texts[field.name].split())


def _operation(call: Call) -> dict[str, Any]:
    names = [part[1:-1] for part in call.path.split("/") if part.startswith("{")]
    text = {"type": "string", "minLength": 1}
    parameters: list[dict[str, Any]] = [
        {
            "name": one,
            "in": "path",
            "required": True,
            "description": _IN_PATH[one],
            "schema": text,
        }
        for one in names
    ]
    parameters += [
        {
            "name": one.name,
            "in": "query",
            "required": False,
            "description": one.summary,
            "schema": {"type": one.type},
        }
        for one in call.query
    ]
    found: dict[str, Any] = {
        "operationId": call.name,
        "summary": call.summary,
        "description": f"Right: {_right(call.right)}.",
        "security": [] if call.right.role is None else [{one: []} for one in _SCHEMES],
        "responses": _responses(call, has_names=bool(names)),
    }
    if parameters:
        found["parameters"] = parameters
    if call.body is bytes:
        found["requestBody"] = {"required": True, "content": {"application/octet-stream": {}}}
    elif call.body is not None:
        found["requestBody"] = {"required": call.is_body_needed, "content": _json(call.body)}
    return found


def _right(right: Right) -> str:
    if right.role is None:
        return "none; a sign-in is not required"
    if right.is_local:
        return "the start key"
    where = {
        "robot": "for this robot",
        "server": "for all robots",
        "anywhere": "for at least one robot",
    }
    return f"{right.role} {where[right.scope]}"


def _responses(call: Call, *, has_names: bool) -> dict[str, Any]:
    statuses = {*_ALL, *call.errors}
    if call.right.role is not None:
        statuses |= {401, 403}
    if has_names:
        statuses.add(404)
    if call.method == "POST":
        statuses.add(403)  # a page from another site
    if call.body is not None:
        statuses |= {400, 415}
    content: dict[str, Any] = {media: {} for media in call.media}
    if call.answer is not None:
        content |= _json(call.answer)
    responses: dict[str, Any] = {str(call.status): {"description": "Done.", "content": content}}
    for status in sorted(statuses):
        phrase = HTTPStatus(status).phrase
        responses[str(status)] = {"description": f"{phrase}.", "content": _json(Failure)}
    return responses


def _json(kind: type) -> dict[str, Any]:
    return {JSON: {"schema": {"$ref": f"#/components/schemas/{kind.__name__}"}}}
