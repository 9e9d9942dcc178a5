"""Routes for signing in with a name and a passphrase and for signing out.

Layer 5. Attempts are limited per address and per name. At most two passphrases are hashed at a
time.
"""

import asyncio
from contextlib import suppress

from starlette.requests import Request
from starlette.responses import Response

from urc.access.grants import AccessError
from urc.access.passphrases import WRONG, person_by_passphrase
from urc.web.people.browser_sign_ins import BrowserSignIns, answers_refusals
from urc.web.people.messages import SignInRequest, SignInResult
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import ApiError, Endpoint, answer, body_of
from urc.web.serve.visitor import visitor_of
from urc.web.words import t

__all__ = ["SignInRoutes"]


class SignInRoutes:
    """The routes for signing in and out."""

    def __init__(self, sign_ins: BrowserSignIns) -> None:
        """Create the routes.

        Args:
            sign_ins: the sign-ins of all browsers.
        """
        self._sign_ins = sign_ins

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoints, keyed by call name."""
        return {
            "sign_in": self.sign_in,
            "sign_out": self.sign_out,
        }

    @answers_refusals
    async def sign_in(self, request: Request) -> Response:
        """Sign in a person with a name and a passphrase."""
        sign_ins = self._sign_ins
        said = await body_of(request, SignInRequest)
        key = f"name {' '.join(said.name.split()).casefold()}"
        sign_ins.check_wait(request, key)
        store = sign_ins.store
        async with sign_ins.hashing():
            # Other attempts may have failed while this one waited for its turn.
            sign_ins.check_wait(request, key)
            found = await asyncio.to_thread(person_by_passphrase, store, said.name, said.passphrase)
            if not found:
                tried = (await asyncio.to_thread(store.passphrase_of, said.name))[0]
                sign_ins.failed(request, "passphrase", AccessError(WRONG), key, person=tried)
                raise ApiError(403, t("The name or the passphrase is wrong."))
        sign_ins.succeeded(key)
        person = sign_ins.control.directory.principals.get(found)
        if person is None:  # removed, or added, a moment ago
            raise ApiError(403, t("The name or the passphrase is wrong."))
        done = answer(SignInResult(person.name))
        await sign_ins.open(request, done, person, "passphrase")
        return done

    @answers_refusals
    async def sign_out(self, request: Request) -> Response:
        """End this browser's sign-in; a paired device stays paired."""
        who = visitor_of(request).identity
        access = self._sign_ins.access
        if visitor_of(request).is_program:
            raise ApiError(409, t("A program cannot sign out: remove its token."))
        if who.kind in ("person", "guest"):
            self._sign_ins.recorder.signed_out(actor_of(request))
        if who.kind == "person":  # other guests may use the same link
            with suppress(AccessError):  # it has ended in the meantime
                await access.control.end_sign_in(who.sign_in)
        done = answer(SignInResult(""))
        for line in access.forgotten(request.scope["headers"]):
            done.headers.append("set-cookie", line)
        return done
