"""Why did it move? The audit of one robot, as JSON for the dev page.

Floor 5. It shows what went over a robot's lines, so it needs the start key, as the dev
page is. ``?last=`` says how many entries, newest first, ``?since=`` from when on (UTC, seconds).
"""

import asyncio

from starlette.requests import Request
from starlette.responses import JSONResponse

from urc.runtime.audit import AuditLog, Entry, read

__all__ = ["timeline"]

MOST = 1000
USUAL = 200
_HEADERS = {"cache-control": "no-store"}
_SETTLE_S = 0.5


async def timeline(
    request: Request, log: AuditLog | None, robot: str, *, is_here: bool
) -> JSONResponse:
    """Return what happened to a robot, newest first.

    Args:
        request: its query says how much of it.
        log: where it is kept; None: nowhere.
        robot: whose.
        is_here: whether who asks has the start key.
    """
    if not is_here:
        text = "the timeline needs the key in the address that URC printed"
        return JSONResponse({"error": text}, 403, _HEADERS)
    if log is None:
        text = "no audit is kept: this server has no folder for its data"
        return JSONResponse({"error": text}, 404, _HEADERS)
    try:
        last = int(request.query_params.get("last", USUAL))
        since = float(request.query_params.get("since", 0))
    except ValueError:
        return JSONResponse({"error": "'last' and 'since' are numbers"}, 400, _HEADERS)
    if not 1 <= last <= MOST or not 0 <= since < float("inf"):
        text = f"'last' is 1 to {MOST}, 'since' a time in seconds since 1970"
        return JSONResponse({"error": text}, 400, _HEADERS)
    try:
        found = await asyncio.to_thread(_settled, log, robot, since, last)
    except OSError as error:
        return JSONResponse({"error": str(error)}, 503, _HEADERS)
    entries = [one._asdict() for one in reversed(found)]
    return JSONResponse({"entries": entries, "fault": log.fault}, headers=_HEADERS)


def _settled(log: AuditLog, robot: str, since: float, last: int) -> list[Entry]:
    log.settle(_SETTLE_S)  # what has just happened is asked for the most
    return read(log.file, robot=robot, since=since, last=last)
