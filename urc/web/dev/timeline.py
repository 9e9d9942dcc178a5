"""The audit log of one robot as JSON, which shows the causes of its motion on the developer page.

Layer 5. The timeline contains traffic of the robot, so it requires the role ``maintain``. The query
parameter ``last`` is the maximum number of entries; the newest entry is first. The query parameter
``since`` is the earliest time, in seconds since 1970 (UTC).
"""

import asyncio

from starlette.requests import Request
from starlette.responses import JSONResponse

from urc.runtime.audit import AuditLog
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_search import AuditQuery, search

__all__ = ["timeline"]

MOST = 1000
USUAL = 200
_HEADERS = {"cache-control": "no-store"}
_SETTLE_S = 0.5


async def timeline(request: Request, log: AuditLog | None, robot: str) -> JSONResponse:
    """Return the audit log entries of a robot, newest first.

    Args:
        request: the request; its query limits the entries.
        log: the audit log; None if the server has none.
        robot: name of the robot.
    """
    if log is None:
        text = "there is no audit log: this server has no folder for its data"
        return JSONResponse({"error": text}, 404, _HEADERS)
    try:
        last = int(request.query_params.get("last", USUAL))
        since = float(request.query_params.get("since", 0))
    except ValueError:
        return JSONResponse({"error": "expected numbers for 'last' and 'since'"}, 400, _HEADERS)
    if not 1 <= last <= MOST or not 0 <= since < float("inf"):
        text = f"expected 'last' from 1 to {MOST}, and 'since' in seconds since 1970"
        return JSONResponse({"error": text}, 400, _HEADERS)
    try:
        found = await asyncio.to_thread(_settled, log, robot, since, last)
    except OSError as error:
        return JSONResponse({"error": str(error)}, 503, _HEADERS)
    entries = [one._asdict() for one in found]
    return JSONResponse({"entries": entries, "fault": log.fault}, headers=_HEADERS)


def _settled(log: AuditLog, robot: str, since: float, last: int) -> list[AuditEntry]:
    log.settle(_SETTLE_S)  # the newest entries matter most
    query = AuditQuery(robot=robot, since=since, last=last)
    return [row.entry for row in search(log.file, query)]
