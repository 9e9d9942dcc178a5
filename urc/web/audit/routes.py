"""Routes for the audit log: the page, the search, the export and the timeline of a robot.

Layer 5. Visitors with the role ``maintain`` for all robots see all entries. Other visitors see the
entries about robots that they may maintain. Threads read the log, because reading would block the
event loop.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Iterable
from dataclasses import dataclass
from typing import Final

from starlette.concurrency import iterate_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response, StreamingResponse

from urc.runtime.audit import AuditLog
from urc.runtime.audit_check import exported
from urc.runtime.audit_search import AuditQuery, SearchTimeout, search
from urc.runtime.audit_table import AuditRow
from urc.runtime.server_recorder import ServerRecorder
from urc.web.audit.query import BadQuery, query_of
from urc.web.manage.wire import AuditResult
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import Endpoint, answer, told
from urc.web.serve.rights import (
    MAINTAIN,
    MAINTAIN_ANYWHERE,
    MAINTAIN_SERVER,
    ProtectedRoute,
)
from urc.web.serve.visitor import visitor_of
from urc.web.show.menu import Nav, NavigationLinks
from urc.web.show.pages import PageHead, render
from urc.web.words import t

__all__ = ["AuditPage", "AuditRoutes"]

_NO_LOG: Final = "this server has no audit log, because it has no data folder"
_NO_STORE: Final = {"cache-control": "no-store"}
_SETTLE_S: Final = 0.5
_SEARCHES: Final = 2
"""Maximum number of concurrent searches; the limit leaves threads free for other work."""
_EXPORTS: Final = 4
"""Maximum number of concurrent exports."""


@dataclass(frozen=True, slots=True)
class AuditPage:
    """Context for ``audit.html.j2``: the filters. The page itself loads the entries."""

    head: PageHead
    nav: Nav
    robots: tuple[str, ...]
    """Names of the robots whose entries the visitor may see."""
    sees_all: bool
    """Whether the visitor also sees entries about the server."""


class AuditRoutes:
    """The routes for the audit log."""

    def __init__(
        self,
        log: AuditLog | None,
        recorder: ServerRecorder,
        robots: Callable[[], Iterable[str]],
        ways: NavigationLinks,
    ) -> None:
        """Create the routes.

        Args:
            log: the audit log; None if the server has no data folder.
            recorder: receives an entry for each export.
            robots: function that returns the names of the served robots.
            ways: navigation links of this server.
        """
        self._log = log
        self._recorder = recorder
        self._robots = robots
        self._ways = ways
        self._searching = asyncio.Semaphore(_SEARCHES)
        self._exports = 0

    def routes(self) -> list[ProtectedRoute]:
        """Return the route of the audit page."""
        return [ProtectedRoute("/audit", self.page, MAINTAIN_ANYWHERE)]

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the API endpoints, keyed by call name."""
        return {"audit": self.entries, "audit_export": self.export, "timeline": self.timeline}

    async def page(self, request: Request) -> Response:
        """Show the page."""
        if self._log is None:
            raise HTTPException(404, t("This server has no audit log."))
        visitor = visitor_of(request)
        page = AuditPage(
            PageHead(request.state.nonce, t("Audit log")),
            Nav("audit", self._ways),
            tuple(sorted(self._visible(request))),
            visitor.may(MAINTAIN_SERVER),
        )
        return HTMLResponse(render("audit.html.j2", page), headers=_NO_STORE)

    async def entries(self, request: Request) -> Response:
        """Return the newest entries that match the query, newest first."""
        robots = self._scope(request)
        return await self._answer(lambda: query_of(request.query_params, robots))

    async def timeline(self, request: Request) -> Response:
        """Return the newest entries about one robot, newest first."""
        name = request.path_params["name"]
        if name not in self._robots():
            return told(404, "this server has no robot with that name")
        return await self._answer(lambda: query_of({**request.query_params, "robot": name}, None))

    async def export(self, request: Request) -> Response:
        """Return all entries that the visitor may see as JSON lines, for `urc audit --check`."""
        if self._log is None:
            return told(404, _NO_LOG)
        if self._exports >= _EXPORTS:
            return told(429, f"{_EXPORTS} exports are in progress: try again in a minute")
        robots = self._scope(request)
        self._recorder.audit_exported(actor_of(request))
        await asyncio.to_thread(self._log.settle, _SETTLE_S)
        name = time.strftime("urc-audit-%Y-%m-%d.jsonl", time.gmtime())
        headers = {**_NO_STORE, "content-disposition": f'attachment; filename="{name}"'}
        lines = self._lines(self._log, robots)
        return StreamingResponse(lines, headers=headers, media_type="application/jsonl")

    def _visible(self, request: Request) -> frozenset[str]:
        visitor = visitor_of(request)
        return frozenset(name for name in self._robots() if visitor.may(MAINTAIN, name))

    def _scope(self, request: Request) -> frozenset[str] | None:
        """Return the robots whose entries the visitor may see; None for all entries."""
        return None if visitor_of(request).may(MAINTAIN_SERVER) else self._visible(request)

    async def _answer(self, query: Callable[[], AuditQuery]) -> Response:
        log = self._log
        if log is None:
            return told(404, _NO_LOG)
        try:
            wanted = query()
            async with self._searching:
                rows = await asyncio.to_thread(_settled, log, wanted)
        except BadQuery as error:
            return told(400, str(error))
        except (SearchTimeout, OSError) as error:
            return told(503, str(error))
        entries = [{"id": row.id, **row.entry._asdict()} for row in rows]
        return answer(AuditResult(entries, log.fault, has_more=len(rows) == wanted.last))

    async def _lines(self, log: AuditLog, robots: frozenset[str] | None) -> AsyncIterator[str]:
        self._exports += 1
        try:
            async for block in iterate_in_threadpool(exported(log.file, robots)):
                yield block
        finally:
            self._exports -= 1


def _settled(log: AuditLog, query: AuditQuery) -> list[AuditRow]:
    log.settle(_SETTLE_S)  # the newest entries matter most
    return search(log.file, query)
