"""Routes for single-use codes, which pair a device or let an invited person choose a passphrase.

Layer 5. The fragment of the page's address contains the code, so server logs never contain it. The
page sends the code in a request body. A code has 128 random bits, and failed attempts delay later
attempts.
"""

import asyncio
from collections.abc import Callable, Mapping
from typing import Final
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import Response

from urc.access.grants import AccessError
from urc.access.pairing import UNKNOWN_CODE, Origin, check_number, free_name, join, pair
from urc.access.passphrases import hash_of
from urc.access.store import Invitation, parse_name
from urc.web.people.browser_sign_ins import BrowserSignIns, address_of, agent_of, answers_refusals
from urc.web.people.messages import (
    CodeInfo,
    CodeRequest,
    JoinRequest,
    PairRequest,
    PairResult,
    RobotLink,
    SignInResult,
)
from urc.web.people.pairings import Pairings
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import ApiError, Endpoint, answer, body_of
from urc.web.serve.rights import WATCH
from urc.web.serve.visitor import Visitor
from urc.web.words import t

__all__ = ["PairingRoutes"]

MOST_LINKS: Final = 8
"""Maximum number of robots listed for a new device; above it, the page links to the menu."""


class PairingRoutes:
    """The routes for new devices and invited people."""

    def __init__(
        self,
        sign_ins: BrowserSignIns,
        pairings: Pairings,
        robots: Callable[[], Mapping[str, str]],
    ) -> None:
        """Create the routes.

        Args:
            sign_ins: the sign-ins of all browsers.
            pairings: the administrators' pending pairings.
            robots: function that returns the titles of all robots, keyed by their names in URLs.
        """
        self._sign_ins = sign_ins
        self._pairings = pairings
        self._robots = robots

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoints, keyed by call name."""
        return {
            "codes": self.look,
            "pair": self.pair,
            "join": self.join,
        }

    @answers_refusals
    async def look(self, request: Request) -> Response:
        """Return the rights that a code grants; the code stays valid."""
        said = await body_of(request, CodeRequest)
        found = await self._invitation(request, said.code)
        directory = self._sign_ins.control.directory
        owner = directory.principals.get(found.owner)
        is_device = found.kind == "device"
        grants = owner.grants if owner is not None else found.grants
        return answer(
            CodeInfo(
                kind=found.kind,
                name=found.name if is_device or owner is None else owner.name,
                suggested=free_name(directory, agent_of(request) or "Browser"),
                owner=owner.name if owner is not None and is_device else "",
                roles=tuple(map(str, grants)),
                ends_at=found.ends_at,
            )
        )

    @answers_refusals
    async def pair(self, request: Request) -> Response:
        """Pair this browser as a device with its own key."""
        sign_ins = self._sign_ins
        said = await body_of(request, PairRequest)
        found = await self._invitation(request, said.code)
        name = found.name or _valid(said.name)
        begun = await asyncio.to_thread(
            pair,
            sign_ins.store,
            said.code,
            name,
            now=sign_ins.control.now(),
            origin=_origin(request),
        )
        await sign_ins.control.reload()
        robots = self._links(begun.secret)
        done = answer(PairResult(begun.principal.name, check_number(begun.sign_in), robots))
        sign_ins.admit(request, done, begun.secret, is_device=True)
        self._pairings.paired(said.code, begun)
        sign_ins.recorder.paired(
            actor_of(request), "code used", name=begun.principal.name, device=begun.principal.id
        )
        return done

    @answers_refusals
    async def join(self, request: Request) -> Response:
        """Set the passphrase of an invited person, and sign the person in."""
        sign_ins = self._sign_ins
        said = await body_of(request, JoinRequest)
        found = await self._invitation(request, said.code)
        person = sign_ins.control.directory.principals.get(found.owner)
        if found.kind != "person" or person is None:
            raise ApiError(403, t("This code is unknown, already used, or expired."))
        try:
            async with sign_ins.hashing():
                kept = await asyncio.to_thread(hash_of, said.passphrase, name=person.name)
        except AccessError as error:
            raise ApiError(422, str(error)) from None
        begun = await asyncio.to_thread(
            join,
            sign_ins.store,
            said.code,
            kept,
            now=sign_ins.control.now(),
            origin=_origin(request),
        )
        await sign_ins.control.reload()
        done = answer(SignInResult(person.name))
        who = sign_ins.admit(request, done, begun.secret)
        actor = actor_of(request)._replace(name=who.name, principal=who.principal, kind="person")
        sign_ins.recorder.access_changed(actor, "people join", name=person.name)
        return done

    async def _invitation(self, request: Request, code: str) -> Invitation:
        """Return the invitation for a code; count an unknown code and raise `ApiError`."""
        sign_ins = self._sign_ins
        sign_ins.check_wait(request)
        found = await asyncio.to_thread(sign_ins.store.invitation, code, sign_ins.control.now())
        if found is None:
            sign_ins.failed(request, "pairing", AccessError(UNKNOWN_CODE))
            raise ApiError(403, t("This code is unknown, already used, or expired."))
        return found

    def _links(self, secret: str) -> tuple[RobotLink, ...]:
        """Return the robots that a new sign-in permits; () if there are too many for a list."""
        access = self._sign_ins.access
        visitor = Visitor(access, access.control.identify(secret))
        found = [
            RobotLink(title, f"/robots/{quote(name, safe='')}/")
            for name, title in self._robots().items()
            if visitor.may(WATCH, name)
        ]
        return tuple(found) if len(found) <= MOST_LINKS else ()


def _valid(name: str) -> str:
    try:
        return parse_name(name)
    except AccessError as error:
        raise ApiError(422, str(error)) from None


def _origin(request: Request) -> Origin:
    return Origin(address_of(request), agent_of(request))
