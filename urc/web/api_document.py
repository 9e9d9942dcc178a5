"""The OpenAPI 3.1 document of ``/api/v1``, generated from the types that the server decodes.

Layer 5. The schemas are generated from `urc.web.manage.wire`, so the document matches the server. A
test compares the documented paths with the routes.
"""

from functools import cache
from typing import Any, Final, NamedTuple

import msgspec
from starlette.requests import Request
from starlette.responses import Response

from urc import __version__
from urc.web.audit.query import PARAMETERS
from urc.web.manage.wire import (
    Add,
    AuditResult,
    ControlState,
    Failure,
    HealthStatus,
    InstallRequest,
    JobDecision,
    JobNews,
    PackageList,
    PlaybackRequest,
    PlaybackState,
    RefreshRequest,
    ReloadResult,
    RemovedPackages,
    ResultLine,
    SettingsAnswer,
    SettingsAsked,
    StopResult,
    Url,
)

__all__ = ["DOCUMENT", "api_document", "document"]

DOCUMENT: Final = "/api/v1/openapi.json"


class _Call(NamedTuple):
    path: str
    summary: str
    answer: type
    """Type of the response; `bytes` for JSON lines."""
    body: type | None = None
    """Type of the request body; None for a GET request, or for a POST request without a body."""
    is_post: bool = True
    status: int = 200
    query: tuple[str, ...] = ()


_CALLS: Final = (
    _Call("/healthz", "The health of the server, and its version.", HealthStatus, is_post=False),
    _Call(
        "/api/v1/packages",
        "Installed packages, packages available from repositories, and the current job.",
        PackageList,
        is_post=False,
        query=("kinds", "words"),
    ),
    _Call(
        "/api/v1/repositories/ask",
        "Start a refresh of the package lists.",
        ResultLine,
        RefreshRequest,
        status=202,
    ),
    _Call("/api/v1/repositories", "Add a repository, which must respond.", ResultLine, Url),
    _Call("/api/v1/repositories/remove", "Forget a repository.", ResultLine, Url),
    _Call(
        "/api/v1/packages/install",
        "Start a job that downloads a package with its dependencies and lists its permissions.",
        JobNews,
        InstallRequest,
        status=202,
    ),
    _Call(
        "/api/v1/packages/add",
        "Start a job for a package given by its path in a repository or on this machine.",
        JobNews,
        Add,
        status=202,
    ),
    _Call(
        "/api/v1/packages/upload",
        "Start a job for an uploaded package, bundle or interface.yaml in the request body.",
        JobNews,
        bytes,
        status=202,
        query=("name",),
    ),
    _Call(
        "/api/v1/packages/update",
        "Start a job that downloads a newer version of a package and lists the changes.",
        JobNews,
        InstallRequest,
        status=202,
    ),
    _Call(
        "/api/v1/packages/back",
        "Restore the version of a package before its last update.",
        RemovedPackages,
        InstallRequest,
    ),
    _Call(
        "/api/v1/packages/remove",
        "Remove a package; without yes, only list the packages that would be removed.",
        RemovedPackages,
        InstallRequest,
    ),
    _Call(
        "/api/v1/job/agree", "Install the planned package after its approval.", JobNews, JobDecision
    ),
    _Call("/api/v1/job/cancel", "Cancel the job before it changes anything.", JobNews, JobDecision),
    _Call(
        "/api/v1/robots/{name}/settings",
        "Test the settings with the robot, then store and use them immediately.",
        SettingsAnswer,
        SettingsAsked,
    ),
    _Call("/api/v1/robots/{name}/stop", "Stop a robot and latch its STOP.", StopResult),
    _Call(
        "/api/v1/robots/{name}/controls",
        "The operator who drives a robot, and the state of its STOP latch.",
        ControlState,
        is_post=False,
    ),
    _Call(
        "/api/v1/audit",
        "Search the audit log, newest entry first.",
        AuditResult,
        is_post=False,
        query=PARAMETERS,
    ),
    _Call(
        "/api/v1/audit/export",
        "All visible entries of the audit log as JSON lines, oldest entry first.",
        bytes,
        is_post=False,
    ),
    _Call(
        "/api/v1/robots/{name}/timeline",
        "Search the audit log for entries of one robot, newest entry first.",
        AuditResult,
        is_post=False,
        query=tuple(one for one in PARAMETERS if one != "robot"),
    ),
    _Call(
        "/api/v1/robots/{name}/recording",
        "State of the playback of a recording.",
        PlaybackState,
        is_post=False,
    ),
    _Call(
        "/api/v1/robots/{name}/recording/move",
        "Play, pause or seek the playback of a recording.",
        PlaybackState,
        PlaybackRequest,
    ),
    _Call(
        "/api/v1/robots/{name}/dev/start",
        "Reload the documents of a robot; needs --dev and the start key.",
        ReloadResult,
    ),
)


async def document(_: Request) -> Response:
    """Return the document as a response."""
    headers = {"cache-control": "no-store"}
    return Response(api_document(), media_type="application/json", headers=headers)


@cache
def api_document() -> bytes:
    """Return the document as JSON."""
    kinds = [call.answer for call in _CALLS if call.answer is not bytes]
    kinds += [call.body for call in _CALLS if call.body not in (None, bytes)]
    kinds.append(Failure)
    _, components = msgspec.json.schema_components(
        list(dict.fromkeys(kinds)), ref_template="#/components/schemas/{name}"
    )
    paths = {call.path: {"post" if call.is_post else "get": _operation(call)} for call in _CALLS}
    found = {
        "openapi": "3.1.0",
        "info": {
            "title": "URC",
            "version": __version__,
            "description": "Each change is a POST request from the server's own origin;"
            " the server checks the Origin header.",
        },
        "paths": paths,
        "components": {"schemas": components},
    }
    return msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n"


def _operation(call: _Call) -> dict[str, Any]:
    names = [part[1:-1] for part in call.path.split("/") if part.startswith("{")]
    text = {"type": "string"}
    parameters = [{"name": one, "in": "path", "required": True, "schema": text} for one in names]
    parameters += [
        {"name": one, "in": "query", "required": False, "schema": text} for one in call.query
    ]
    failure = {"description": "Reason for the failure, in one line.", "content": _json(Failure)}
    content = {"application/jsonl": {}} if call.answer is bytes else _json(call.answer)
    found: dict[str, Any] = {
        "summary": call.summary,
        "responses": {
            str(call.status): {"description": "Done.", "content": content},
            "4XX": failure,
        },
    }
    if parameters:
        found["parameters"] = parameters
    if call.body is bytes:
        found["requestBody"] = {"required": True, "content": {"application/octet-stream": {}}}
    elif call.body is not None:
        found["requestBody"] = {"required": True, "content": _json(call.body)}
    return found


def _json(kind: type) -> dict[str, Any]:
    return {"application/json": {"schema": {"$ref": f"#/components/schemas/{kind.__name__}"}}}
