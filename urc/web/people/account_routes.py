"""Routes for visitors' own accounts (passphrase, devices and sign-ins) and for admitting guests.

Layer 5. Visitors can change only their own devices and sign-ins.
"""

import asyncio

from starlette.requests import Request
from starlette.responses import Response

from urc.access.administration import overview, replace_passphrase
from urc.access.directory import NOBODY, Identity
from urc.access.grants import AccessError
from urc.access.passphrases import hash_of, matches
from urc.access.store import Invitation
from urc.web.manage.wire import ResultLine
from urc.web.people.browser_sign_ins import BrowserSignIns, answers_changes
from urc.web.people.link_maker import LinkMaker
from urc.web.people.lists import principal_info, sign_in_list
from urc.web.people.messages import (
    AccountInfo,
    CodeRequest,
    GuestResult,
    PassphraseRequest,
    PrincipalChoice,
    SignInChoice,
    SignInResult,
)
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import ApiError, Endpoint, answer, body_of
from urc.web.serve.rights import stale_text
from urc.web.serve.visitor import visitor_of
from urc.web.words import t

__all__ = ["AccountRoutes"]

LINK_OVER = "this link is unknown or has expired"


class AccountRoutes:
    """The routes with which visitors manage their own accounts, and guests are admitted."""

    def __init__(self, sign_ins: BrowserSignIns, links: LinkMaker) -> None:
        """Create the routes.

        Args:
            sign_ins: the sign-ins of all browsers.
            links: object that creates pairing links.
        """
        self._sign_ins = sign_ins
        self._links = links
        self._control = sign_ins.control

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoints, keyed by call name."""
        return {
            "guest": self.guest,
            "account": self.account,
            "account_passphrase": self.passphrase,
            "account_devices_pair": self.pair,
            "account_devices_remove": self.remove,
            "account_sign_ins_end": self.end,
        }

    @answers_changes
    async def guest(self, request: Request) -> Response:
        """Admit a guest who presents the secret from a guest link."""
        said = await body_of(request, CodeRequest)
        self._sign_ins.check_wait(request)
        who = self._control.identify(said.code)
        if who == NOBODY or who.way != "link":
            self._sign_ins.failed(request, "link", AccessError(LINK_OVER))
            raise ApiError(403, t("This link is unknown or has expired."))
        (grant,) = self._control.directory.principals[who.principal].grants
        done = answer(GuestResult(f"/robots/{grant.scope}/"))
        self._sign_ins.admit(request, done, said.code)
        return done

    @answers_changes
    async def account(self, request: Request) -> Response:
        """Return the visitor's own account."""
        visitor = visitor_of(request)
        who = visitor.identity
        directory, now = self._control.directory, self._control.now()
        found = []
        if self._control.store is not None:
            found = await asyncio.to_thread(overview, self._control.store, now)
        devices = [one for one in found if one.principal.owner == who.person != ""]
        own = next((one for one in found if one.principal.id == who.principal), None)
        holder = directory.principals.get(who.person)
        mine = self._own(who)
        return answer(
            AccountInfo(
                name=who.name,
                kind=who.kind,
                roles=tuple(map(str, holder.grants if holder else ())),
                has_passphrase=own is not None and own.has_passphrase,
                is_local=visitor.is_local,
                may_pair=_is_person(who),
                devices=tuple(map(principal_info, devices)) if who.kind == "person" else (),
                sign_ins=sign_in_list(
                    directory, now, who.sign_in, lambda one: one.principal in mine
                ),
            )
        )

    @answers_changes
    async def passphrase(self, request: Request) -> Response:
        """Change the visitor's own passphrase; all the person's other sign-ins end."""
        sign_ins = self._sign_ins
        said = await body_of(request, PassphraseRequest)
        who = visitor_of(request).identity
        if not _is_person(who):
            raise ApiError(409, t("Only a person has a passphrase."))
        key = f"name {who.name.casefold()}"
        sign_ins.check_wait(request, key)
        store = sign_ins.store
        async with sign_ins.hashing():
            # Other attempts may have failed while this attempt waited for its turn.
            sign_ins.check_wait(request, key)
            _, before = await asyncio.to_thread(store.passphrase_of, who.name)
            if before is None and not visitor_of(request).is_fresh:
                raise ApiError(403, stale_text())
            if before is not None and not await asyncio.to_thread(matches, said.current, before):
                reason = AccessError("the current passphrase is wrong")
                sign_ins.failed(request, "passphrase", reason, key, person=who.principal)
                raise ApiError(403, t("The current passphrase is wrong."))
            kept = await asyncio.to_thread(hash_of, said.passphrase, name=who.name)
        await asyncio.to_thread(replace_passphrase, store, who.principal, kept)
        # Record this before `reload`, which leaves the request without an identity, because its own
        # sign-in has ended, too.
        sign_ins.recorder.access_changed(actor_of(request), "people passphrase", name=who.name)
        done = answer(SignInResult(who.name))
        await self._control.reload()
        person = self._control.directory.principals[who.principal]
        await sign_ins.open(request, done, person, "passphrase")
        return done

    @answers_changes
    async def pair(self, request: Request) -> Response:
        """Return a code for pairing one of the visitor's devices."""
        who = visitor_of(request).identity
        if not _is_person(who):
            raise ApiError(409, t("Only a person can pair devices."))
        invitation = Invitation("device", "", (), who.principal)
        made = await asyncio.to_thread(self._links.pairing, request, invitation)
        self._sign_ins.recorder.paired(
            actor_of(request), "code made", name="", roles=f"roles of {who.name}"
        )
        return answer(made)

    @answers_changes
    async def remove(self, request: Request) -> Response:
        """Remove one of the visitor's devices."""
        said = await body_of(request, PrincipalChoice)
        who = visitor_of(request).identity
        device = self._control.directory.principals.get(said.id)
        if device is None or not _is_person(who) or device.owner != who.principal:
            raise ApiError(404, t("That device is not yours, or was removed."))
        actor = actor_of(request)  # read before the change, which may affect the visitor
        await asyncio.to_thread(self._sign_ins.store.remove, device.id)
        await self._control.reload()
        self._sign_ins.recorder.access_changed(actor, "devices remove", name=device.name)
        return answer(ResultLine(t("removed {name}", name=device.name)))

    @answers_changes
    async def end(self, request: Request) -> Response:
        """End one of the visitor's sign-ins."""
        said = await body_of(request, SignInChoice)
        if visitor_of(request).identity.kind == "guest":
            raise ApiError(
                409, t("A guest cannot end a sign-in, because other guests may use the same link.")
            )
        found = self._control.directory.sign_ins.get(said.id)
        if found is None or found.principal not in self._own(visitor_of(request).identity):
            raise ApiError(404, t("This sign-in has already ended."))
        actor = actor_of(request)  # read before the change, which may affect the visitor
        await self._control.end_sign_in(said.id)
        self._sign_ins.recorder.revoked(actor, "sign-in", name=actor.name, agent=found.agent)
        return answer(ResultLine(t("the sign-in has ended")))

    def _own(self, who: Identity) -> set[str]:
        """Return the ids of a person and the person's devices; for other visitors, one id."""
        if not who.principal or not _is_person(who):
            return {who.principal}
        principals = self._control.directory.principals.values()
        return {one.id for one in principals if who.principal in (one.id, one.owner)}


def _is_person(who: Identity) -> bool:
    """Return whether the visitor is signed in as a stored person."""
    return who.kind == "person" and who.way not in ("key", "token")
