"""Routes for administrators: people, devices, tokens, guests and sign-ins.

Layer 5. Each change is one store transaction, takes effect immediately, and is recorded in the
audit log.
"""

import asyncio
from collections.abc import Iterable
from typing import Final

from starlette.requests import Request
from starlette.responses import Response

from urc.access.administration import (
    add_guest,
    add_token,
    change_grants,
    end_sign_ins,
    invite_person,
    overview,
    principal_named,
)
from urc.access.directory import Kind, Principal
from urc.access.grants import AccessError, Grant, parse_grant
from urc.access.lifetimes import INVITATION_S
from urc.access.store import Invitation, parse_name
from urc.web.manage.wire import ResultLine
from urc.web.people.browser_sign_ins import BrowserSignIns, answers_changes
from urc.web.people.link_maker import LinkMaker
from urc.web.people.lists import principal_info, sign_in_list
from urc.web.people.messages import (
    AddPerson,
    GuestRequest,
    NewToken,
    PairingRequest,
    PrincipalChoice,
    PrincipalList,
    RenameRequest,
    RolesRequest,
    SignInChoice,
    SignInList,
    TokenRequest,
)
from urc.web.people.pairings import Pairings
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import ApiError, Endpoint, answer, body_of
from urc.web.serve.visitor import visitor_of
from urc.web.words import t

__all__ = ["AdminRoutes"]

_DAY_S: Final = 86400.0
_PLURALS: Final[dict[Kind, str]] = {
    "person": "people",
    "device": "devices",
    "program": "tokens",
    "guest": "guests",
}


class AdminRoutes:
    """The routes with which administrators manage identities, rights and sign-ins."""

    def __init__(self, sign_ins: BrowserSignIns, pairings: Pairings, links: LinkMaker) -> None:
        """Create the routes.

        Args:
            sign_ins: the sign-ins of all browsers.
            pairings: the administrators' pending pairings.
            links: object that creates pairing, invitation and guest links.
        """
        self._sign_ins = sign_ins
        self._pairings = pairings
        self._links = links
        self._control = sign_ins.control

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoints, keyed by call name."""
        return {
            "people": self.listed,
            "devices": self.listed,
            "tokens": self.listed,
            "guests": self.listed,
            "sign_ins": self.sign_in_entries,
            "pairing": self.pairing,
            "people_add": self.add,
            "people_invite": self.invite,
            "people_rename": self.rename,
            "people_roles": self.roles,
            "people_remove": self.remove,
            "people_revoke": self.revoke,
            "devices_pair": self.pair,
            "tokens_add": self.token,
            "guests_add": self.guest,
            "sign_ins_end": self.end,
        }

    # Lists

    @answers_changes
    async def listed(self, request: Request) -> Response:
        """Return all people, devices, programs or guests."""
        plural = request.url.path.rpartition("/")[2]
        kind = next(kind for kind, name in _PLURALS.items() if name == plural)
        store, now = self._sign_ins.store, self._control.now()
        found = await asyncio.to_thread(overview, store, now, kind)
        return answer(PrincipalList(tuple(map(principal_info, found))))

    @answers_changes
    async def sign_in_entries(self, request: Request) -> Response:
        """Return all sign-ins."""
        own = visitor_of(request).identity.sign_in
        now = self._control.now()
        return answer(SignInList(sign_in_list(self._control.directory, now, own, lambda _: True)))

    @answers_changes
    async def pairing(self, request: Request) -> Response:
        """Return the state of a pairing; only the pairing's creator knows its random identifier."""
        state = self._pairings.state(request.path_params["id"], self._control.now())
        return answer(state)

    # People, devices, programs and guests

    @answers_changes
    async def add(self, request: Request) -> Response:
        """Add a person."""
        said = await body_of(request, AddPerson)
        grants = _grants(said.roles)
        store, now = self._sign_ins.store, self._control.now()
        one = await asyncio.to_thread(store.add, "person", said.name, grants, now=now)
        await self._changed(request, "people add", name=one.name, roles=_texts(one.grants))
        return answer(ResultLine(t("added {name}", name=one.name)))

    @answers_changes
    async def invite(self, request: Request) -> Response:
        """Return a link with which a person chooses a passphrase."""
        person = self._chosen(await body_of(request, PrincipalChoice), "person")
        now = self._control.now()
        ends_at = now + INVITATION_S
        store = self._sign_ins.store
        _, code = await asyncio.to_thread(
            invite_person, store, person.name, (), now=now, ends_at=ends_at
        )
        made = await asyncio.to_thread(self._links.link, request, "join", code, ends_at)
        await self._changed(request, "people invite", name=person.name)
        return answer(made)

    @answers_changes
    async def rename(self, request: Request) -> Response:
        """Rename a person, device, program or guest."""
        said = await body_of(request, RenameRequest)
        one = self._chosen(PrincipalChoice(said.id))
        await asyncio.to_thread(self._sign_ins.store.rename, one.id, said.name)
        command = f"{_PLURALS[one.kind]} rename"
        await self._changed(request, command, name=one.name, new=parse_name(said.name))
        return answer(ResultLine(t("renamed")))

    @answers_changes
    async def roles(self, request: Request) -> Response:
        """Replace all grants of a person, device or program."""
        said = await body_of(request, RolesRequest)
        one = self._chosen(PrincipalChoice(said.id))
        if one.owner:
            raise AccessError(t("{name} has the roles of its owner.", name=one.name))
        if one.kind == "guest":
            raise AccessError(t("A guest can only watch."))
        grants = _grants(said.roles)
        store = self._sign_ins.store
        await asyncio.to_thread(change_grants, store, one.id, lambda _: grants)
        command = f"{_PLURALS[one.kind]} grant"
        await self._changed(request, command, name=one.name, roles=_texts(grants))
        return answer(ResultLine(t("saved; the change takes effect immediately")))

    @answers_changes
    async def remove(self, request: Request) -> Response:
        """Remove a person, device, program or guest, with all its sign-ins and devices."""
        one = self._chosen(await body_of(request, PrincipalChoice))
        await asyncio.to_thread(self._sign_ins.store.remove, one.id)
        await self._changed(request, f"{_PLURALS[one.kind]} remove", name=one.name)
        return answer(ResultLine(t("removed {name}", name=one.name)))

    @answers_changes
    async def revoke(self, request: Request) -> Response:
        """End all sign-ins of a person and their devices, or of a device, program or guest."""
        one = self._chosen(await body_of(request, PrincipalChoice))
        store = self._sign_ins.store
        ended = await asyncio.to_thread(
            end_sign_ins, store, lambda _, holder: one.id in (holder.id, holder.owner)
        )
        await self._control.reload()
        self._sign_ins.recorder.revoked(
            actor_of(request), "all sign-ins", name=one.name, ended=ended
        )
        return answer(ResultLine(t("{count} sign-ins ended", count=ended)))

    # Secrets

    @answers_changes
    async def pair(self, request: Request) -> Response:
        """Return a code for pairing one device."""
        said = await body_of(request, PairingRequest)
        grants = _grants(said.roles)
        owner = self._chosen(PrincipalChoice(said.owner), "person") if said.owner else None
        if (owner is None) == (not grants):
            raise AccessError(t("A device needs either an owner or its own roles."))
        name = parse_name(said.name) if said.name.strip() else ""
        if name and principal_named(self._control.directory, "device", name) is not None:
            raise AccessError(t("A device with this name already exists."))
        invitation = Invitation("device", name, grants, owner.id if owner else "")
        made = await asyncio.to_thread(self._links.pairing, request, invitation)
        rights = f"roles of {owner.name}" if owner else _texts(grants)
        self._sign_ins.recorder.paired(actor_of(request), "code made", name=name, roles=rights)
        return answer(made)

    @answers_changes
    async def token(self, request: Request) -> Response:
        """Add a program and return its token, which is shown only once."""
        said = await body_of(request, TokenRequest)
        store, now = self._sign_ins.store, self._control.now()
        ends_at = None if said.days is None else now + said.days * _DAY_S
        commands = tuple(dict.fromkeys(said.commands))
        program, token = await asyncio.to_thread(
            add_token, store, said.name, _grants(said.roles), now=now, ends_at=ends_at,
            commands=commands,
        )  # fmt: skip
        scope = f"{_texts(program.grants)}; {', '.join(commands) or 'all commands'}"
        await self._changed(request, "tokens add", name=program.name, scope=scope)
        return answer(NewToken(program.name, token, ends_at))

    @answers_changes
    async def guest(self, request: Request) -> Response:
        """Return a guest link for one robot."""
        said = await body_of(request, GuestRequest)
        store, now = self._sign_ins.store, self._control.now()
        ends_at = now + said.hours * 3600
        guest, secret = await asyncio.to_thread(
            add_guest, store, said.name, said.robot, now=now, ends_at=ends_at
        )
        made = await asyncio.to_thread(self._links.link, request, "guest", secret, ends_at)
        await self._changed(request, "guests add", name=guest.name, roles=_texts(guest.grants))
        return answer(made)

    # Sign-ins

    @answers_changes
    async def end(self, request: Request) -> Response:
        """End one sign-in; a device whose sign-in has ended must be paired again."""
        said = await body_of(request, SignInChoice)
        found = self._control.directory.sign_ins.get(said.id)
        if found is None:
            raise AccessError(t("This sign-in has already ended."))
        holder = self._control.directory.principals[found.principal]
        await self._control.end_sign_in(said.id)
        self._sign_ins.recorder.revoked(
            actor_of(request), "sign-in", name=holder.name, agent=found.agent, place=found.place
        )
        return answer(ResultLine(t("the sign-in has ended")))

    # Inside

    def _chosen(self, said: PrincipalChoice, kind: Kind | None = None) -> Principal:
        one = self._control.directory.principals.get(said.id)
        if one is None or one.id == "local" or (kind is not None and one.kind != kind):
            raise ApiError(404, t("That person, device or program was removed."))
        return one

    async def _changed(self, request: Request, command: str, **about: object) -> None:
        """Apply a stored change to all open connections, and record the change in the audit log."""
        actor = actor_of(request)  # read before the change, which may affect the administrator
        await self._control.reload()
        self._sign_ins.recorder.access_changed(actor, command, **about)


def _grants(texts: Iterable[str]) -> tuple[Grant, ...]:
    return tuple(dict.fromkeys(parse_grant(text) for text in texts))


def _texts(grants: Iterable[Grant]) -> str:
    return ", ".join(map(str, grants)) or "no role"
