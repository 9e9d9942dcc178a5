"""Lists of people, devices, programs, guests and sign-ins for pages and programs.

Layer 5. Pure.
"""

from collections.abc import Callable, Iterable

from urc.access.administration import PrincipalStatus
from urc.access.control import LOCAL_USER
from urc.access.directory import Directory, SignIn
from urc.web.people.messages import PrincipalInfo, SignInInfo

__all__ = ["principal_info", "sign_in_list"]


def principal_info(one: PrincipalStatus) -> PrincipalInfo:
    """Return a person, device, program or guest for display."""
    principal = one.principal
    return PrincipalInfo(
        id=principal.id,
        kind=principal.kind,
        name=principal.name,
        owner=one.owner,
        roles=tuple(map(str, principal.grants)),
        commands=principal.commands,
        has_passphrase=one.has_passphrase,
        passkeys=one.passkeys,
        accounts=one.accounts,
        invited_until=one.invited_until,
        sign_ins=one.sign_ins,
        used_at=one.used_at,
        created_at=principal.created_at,
        ends_at=principal.ends_at,
    )


def sign_in_list(
    directory: Directory, now: float, own: str, is_chosen: Callable[[SignIn], bool]
) -> tuple[SignInInfo, ...]:
    """Return the open sign-ins selected by `is_chosen`, most recently used first.

    Args:
        directory: the directory.
        now: UTC time in seconds since 1970.
        own: id of the request's own sign-in.
        is_chosen: function that returns whether to include a sign-in.
    """
    return tuple(_infos(directory, now, own, filter(is_chosen, directory.sign_ins.values())))


def _infos(
    directory: Directory, now: float, own: str, chosen: Iterable[SignIn]
) -> Iterable[SignInInfo]:
    for one in sorted(chosen, key=lambda one: -one.used_at):
        principal = directory.principals.get(one.principal)
        is_start_key = one.principal == LOCAL_USER.id and one.way == "token"
        if principal is None or is_start_key or one.is_over(now):
            continue
        ends = (one.ends_at, None if one.idle_s is None else one.used_at + one.idle_s)
        yield SignInInfo(
            id=one.id,
            principal=one.principal,
            name=principal.name,
            kind=principal.kind,
            way=one.way,
            agent=one.agent,
            place=one.place,
            created_at=one.created_at,
            used_at=one.used_at,
            ends_at=min((each for each in ends if each is not None), default=None),
            is_own=one.id == own,
        )
