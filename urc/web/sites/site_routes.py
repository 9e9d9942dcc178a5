"""Routes for other sites: the list of robots with their states, and documents by digest.

Layer 5. Only connections from other sites reach these routes.
"""

import asyncio
import hashlib
from collections.abc import Callable, Mapping
from time import monotonic, time
from typing import Final

import msgspec
from starlette.requests import Request
from starlette.responses import Response

from urc.runtime.contact_times import ContactTimes
from urc.web.api.describe import summary
from urc.web.api.documents import document_of
from urc.web.api.wire import RobotSummary
from urc.web.fleet.robots import RobotService
from urc.web.serve.replies import ApiError, answer, answers_errors
from urc.web.serve.rights import SITE, ProtectedRoute

__all__ = [
    "DOCUMENT",
    "ROBOTS",
    "WAIT_S",
    "SiteList",
    "SiteRobot",
    "SiteRoutes",
    "digest_of_document",
]

ROBOTS = "/fleet/robots"
DOCUMENT = "/fleet/documents/{name}"
WAIT_S: Final = 2.0
"""Longest wait for a change of the list, in seconds."""
_LOOK_S: Final = 0.1


class SiteRobot(msgspec.Struct, frozen=True):
    """A robot of a site."""

    summary: RobotSummary
    digest: str
    """SHA-256 of the robot's document, in hexadecimal digits; "" if it cannot be read."""


class SiteList(msgspec.Struct, frozen=True):
    """The robots of a site; other sites may have other versions, so unknown keys are ignored."""

    robots: tuple[SiteRobot, ...]
    time: float
    """UTC time at the site, in seconds since 1970."""
    version: str = ""
    """Version of URC at the site."""
    mark: str = ""
    """Digest of all states; a request with the newest mark waits for a change. "" from a site that
    does not wait."""


class SiteRoutes:
    """The routes for other sites."""

    def __init__(
        self,
        services: Callable[[], Mapping[str, RobotService]],
        times: Callable[[str], ContactTimes],
        version: str,
    ) -> None:
        """Create the routes.

        Args:
            services: function that returns the robots, keyed by their names in URLs.
            times: function that returns when a robot was last used and last sent data.
            version: version of URC.
        """
        self._services = services
        self._times = times
        self._version = version
        self._documents: dict[str, tuple[object, bytes]] = {}

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        return [
            ProtectedRoute(ROBOTS, self.robots, SITE),
            ProtectedRoute(DOCUMENT, self.document, SITE),
        ]

    @answers_errors
    async def robots(self, request: Request) -> Response:
        """Return all robots of this site.

        With the query ``after``, wait up to `WAIT_S` for a list with another mark.
        """
        after = request.query_params.get("after", "")
        end_s = monotonic() + WAIT_S
        while True:
            found = await self._robots()
            mark = _mark(found)
            if mark != after or monotonic() >= end_s:
                return answer(SiteList(found, time(), self._version, mark))
            await asyncio.sleep(_LOOK_S)

    async def _robots(self) -> tuple[SiteRobot, ...]:
        found = []
        for name, service in sorted(self._services().items()):
            if service.robot.playback is None:
                data = await self._document(name, service)
                digest = digest_of_document(data) if data else ""
                one = summary(name, service, "watch", self._times(name))
                found.append(SiteRobot(one, digest))
        return tuple(found)

    @answers_errors
    async def document(self, request: Request) -> Response:
        """Return the document of a robot as one YAML file, without setting values."""
        name = request.path_params["name"]
        service = self._services().get(name)
        if service is None:
            raise ApiError(404, f"this site has no robot {name!r}", "unknown-robot")
        data = await self._document(name, service)
        if not data:
            raise ApiError(409, "the document of this robot can no longer be read", "not-readable")
        return Response(data, media_type="application/yaml")

    async def _document(self, name: str, service: RobotService) -> bytes:
        profile = service.robot.profile
        kept = self._documents.get(name)
        if kept is None or kept[0] is not profile:
            try:
                data = await asyncio.to_thread(document_of, profile)
            except ApiError:
                data = b""
            kept = self._documents[name] = (profile, data)
        return kept[1]


def _mark(robots: tuple[SiteRobot, ...]) -> str:
    """Return the digest of a list, without the times of last use and last data."""
    lasting = [
        SiteRobot(msgspec.structs.replace(one.summary, used_at=None, seen_at=None), one.digest)
        for one in robots
    ]
    return hashlib.sha256(msgspec.json.encode(lasting)).hexdigest()


def digest_of_document(data: bytes) -> str:
    """Return the SHA-256 of a document, in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()
