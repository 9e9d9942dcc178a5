"""Routes for signing in with a passkey and for adding, renaming and removing one's own passkeys.

Layer 5. Only people have passkeys. Adding a passkey requires a recent sign-in, so a passer-by
cannot add a passkey to the operator's account on a shared tablet.
"""

import asyncio

from starlette.requests import Request
from starlette.responses import Response

from urc.access.directory import Principal
from urc.access.grants import AccessError
from urc.access.passkey_table import Passkey, PasskeyTable
from urc.access.passkeys import Passkeys, RelyingParty, relying_party
from urc.web.people.browser_sign_ins import BrowserSignIns, address_of, answers_refusals
from urc.web.people.messages import SignInResult
from urc.web.people.passkey_messages import (
    PasskeyAnswer,
    PasskeyChoice,
    PasskeyLine,
    PasskeyList,
    PasskeyName,
)
from urc.web.serve.actors import actor_of
from urc.web.serve.policy import parse_host
from urc.web.serve.replies import ApiError, answer, body_of
from urc.web.serve.rights import ANYONE, SIGNED_IN, SIGNED_IN_FRESH, ProtectedRoute
from urc.web.serve.visitor import visitor_of

__all__ = ["PasskeyRoutes"]


class PasskeyRoutes:
    """The routes for passkeys."""

    def __init__(self, sign_ins: BrowserSignIns) -> None:
        """Create the routes.

        Args:
            sign_ins: the sign-ins of all browsers.
        """
        self._sign_ins = sign_ins
        store = sign_ins.control.store
        self._known = Passkeys(PasskeyTable(store)) if store is not None else None

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        own = "/account/passkeys"
        return [
            ProtectedRoute(
                "/sign-in/passkey/options", self.sign_in_options, ANYONE, methods=["POST"]
            ),
            ProtectedRoute("/sign-in/passkey", self.sign_in, ANYONE, methods=["POST"]),
            ProtectedRoute(own, self.listed, SIGNED_IN),
            ProtectedRoute(f"{own}/options", self.options, SIGNED_IN_FRESH, methods=["POST"]),
            ProtectedRoute(f"{own}/add", self.add, SIGNED_IN_FRESH, methods=["POST"]),
            ProtectedRoute(f"{own}/rename", self.rename, SIGNED_IN, methods=["POST"]),
            ProtectedRoute(f"{own}/remove", self.remove, SIGNED_IN, methods=["POST"]),
        ]

    # Sign-in

    @answers_refusals
    async def sign_in_options(self, request: Request) -> Response:
        """Return the WebAuthn options for a sign-in."""
        self._sign_ins.check_wait(request)
        found = await asyncio.to_thread(
            self._passkeys.authentication, _party(request), address_of(request)
        )
        return answer(found)

    @answers_refusals
    async def sign_in(self, request: Request) -> Response:
        """Sign in the passkey's owner."""
        self._sign_ins.check_wait(request)
        said = await body_of(request, PasskeyAnswer)
        party = _party(request)
        now = self._sign_ins.control.now()
        try:
            passkey = await asyncio.to_thread(
                self._passkeys.authenticate, party, said.response, now
            )
            person = self._sign_ins.control.directory.principals.get(passkey.principal)
            if person is None:
                raise AccessError("the owner of the passkey was removed")
            if person.ends_at is not None and now >= person.ends_at:
                raise AccessError(
                    f"the rights of {person.name!r} have ended: sign in with the identity provider"
                )
            done = answer(SignInResult(person.name))
            await self._sign_ins.open(request, done, person, "passkey")
        except AccessError as error:
            self._sign_ins.failed(request, "passkey", error)
            raise
        return done

    # One's own passkeys

    @answers_refusals
    async def listed(self, request: Request) -> Response:
        """Return the person's passkeys."""
        passkeys = await asyncio.to_thread(self._passkeys.table.of, _person(request).id)
        return answer(PasskeyList([_line(each) for each in passkeys]))

    @answers_refusals
    async def options(self, request: Request) -> Response:
        """Return the WebAuthn options for a new passkey."""
        found = await asyncio.to_thread(
            self._passkeys.registration, _person(request), _party(request), address_of(request)
        )
        return answer(found)

    @answers_refusals
    async def add(self, request: Request) -> Response:
        """Add a passkey for the person."""
        said = await body_of(request, PasskeyAnswer)
        passkey = await asyncio.to_thread(
            self._passkeys.register, _person(request), _party(request), said.response, said.name,
            self._sign_ins.control.now(),
        )  # fmt: skip
        self._record(request, "passkeys add", passkey.name)
        return answer(_line(passkey))

    @answers_refusals
    async def rename(self, request: Request) -> Response:
        """Rename one of the person's passkeys."""
        said = await body_of(request, PasskeyName)
        table, owner = self._passkeys.table, _person(request).id
        await asyncio.to_thread(table.rename, owner, said.id, said.name)
        self._record(request, "passkeys rename", said.name)
        return await self.listed(request)

    @answers_refusals
    async def remove(self, request: Request) -> Response:
        """Remove one of the person's passkeys."""
        said = await body_of(request, PasskeyChoice)
        table, owner = self._passkeys.table, _person(request).id
        names = {one.id: one.name for one in await asyncio.to_thread(table.of, owner)}
        await asyncio.to_thread(table.remove, owner, said.id)
        self._record(request, "passkeys remove", names.get(said.id, ""))
        return await self.listed(request)

    @property
    def _passkeys(self) -> Passkeys:
        if self._known is None:
            raise ApiError(404, "this server has no list of people, so it has no passkeys")
        return self._known

    def _record(self, request: Request, command: str, name: str) -> None:
        self._sign_ins.recorder.access_changed(actor_of(request), command, passkey=name)


def _person(request: Request) -> Principal:
    """Return the signed-in person; raise `ApiError` for other visitors."""
    visitor = visitor_of(request)
    who = visitor.identity
    if who.kind != "person" or visitor.is_local or visitor.is_program:
        raise ApiError(403, "only people have passkeys: sign in as a person first")
    return Principal(who.principal, "person", who.name)


def _party(request: Request) -> RelyingParty:
    authority = parse_host(request.headers["host"])
    if authority is None:
        raise ApiError(400, "the host header is invalid")  # the page policy has already refused it
    return relying_party(authority.host, authority.port)


def _line(one: Passkey) -> PasskeyLine:
    used_at = one.used_at if one.used_at > one.created_at else None
    return PasskeyLine(one.id, one.name, one.host, one.created_at, used_at)
