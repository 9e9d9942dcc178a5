"""Routes for other sites about certificates: renewal by the authority, and revocation lists.

Layer 5.
"""

import asyncio

from starlette.requests import Request
from starlette.responses import Response

from urc.fleet.names import FleetError
from urc.web.serve.replies import ApiError, answer, answers_errors
from urc.web.serve.rights import SITE, ProtectedRoute
from urc.web.serve.site_peer import CERTIFICATE
from urc.web.sites.member import REVOCATIONS, Member

__all__ = ["MemberRoutes"]

_BYTES = "application/octet-stream"


class MemberRoutes:
    """The routes of a server that belongs to a fleet."""

    def __init__(self, member: Member) -> None:
        self._member = member

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        return [
            ProtectedRoute(CERTIFICATE, self.certificate, SITE, methods=["POST"]),
            ProtectedRoute(REVOCATIONS, self.revocations, SITE),
            ProtectedRoute(REVOCATIONS, self.take, SITE, methods=["POST"]),
        ]

    @answers_errors
    async def certificate(self, request: Request) -> Response:
        """Return a new certificate for the site that asks."""
        csr, peer = await request.body(), request.scope["state"]["site"]
        try:
            chain = await asyncio.to_thread(self._member.renewed_for, csr, peer)
        except FleetError as fault:
            raise ApiError(403, str(fault), "refused") from fault
        return Response(chain, media_type=_BYTES)

    @answers_errors
    async def revocations(self, _: Request) -> Response:
        """Return the newest known revocation list, or an empty response."""
        signed = await asyncio.to_thread(self._member.signed_revocations)
        return Response(signed, media_type=_BYTES)

    @answers_errors
    async def take(self, request: Request) -> Response:
        """Store a newer revocation list."""
        try:
            return answer({"newer": self._member.take_revocations(await request.body())})
        except FleetError as fault:
            raise ApiError(403, str(fault), "refused") from fault
