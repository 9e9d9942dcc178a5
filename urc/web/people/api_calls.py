"""The API calls for people, devices, tokens and sign-ins, which the table of all calls includes.

Layer 5. Pure.
"""

from typing import Final, NamedTuple

from urc.web.manage.wire import ResultLine
from urc.web.people import messages as told
from urc.web.serve.rights import (
    ADMINISTER,
    ADMINISTER_FRESH,
    ANYONE,
    SIGNED_IN,
    SIGNED_IN_FRESH,
    Right,
)

__all__ = ["PEOPLE_CALLS", "PeopleCall"]


class PeopleCall(NamedTuple):
    """One call."""

    path: str
    """Path after ``/api/v1/``."""
    right: Right
    summary: str
    answer: type
    body: type | None = None
    """Type of the request body; None for a request without a body."""
    is_post: bool = True

    @property
    def name(self) -> str:
        """Unique name, which is also the endpoint's key."""
        path = self.path.removesuffix("s/{id}")
        return path.replace("/", "_").replace("-", "_")


def _list(path: str, right: Right, summary: str, answer: type) -> PeopleCall:
    return PeopleCall(path, right, summary, answer, is_post=False)


PEOPLE_CALLS: Final = (
    PeopleCall(
        "sign-in",
        ANYONE,
        "Sign a browser in with a name and a passphrase; the response sets the cookie.",
        told.SignInResult,
        told.SignInRequest,
    ),
    PeopleCall("sign-out", ANYONE, "End the sign-in of the browser.", told.SignInResult),
    PeopleCall(
        "codes",
        ANYONE,
        "The rights that a pairing or invitation code grants; the code stays valid.",
        told.CodeInfo,
        told.CodeRequest,
    ),
    PeopleCall(
        "pair",
        ANYONE,
        "Pair the browser as a device; the response sets the device's key in a cookie.",
        told.PairResult,
        told.PairRequest,
    ),
    PeopleCall(
        "join",
        ANYONE,
        "Set the passphrase of an invited person, and sign the person in.",
        told.SignInResult,
        told.JoinRequest,
    ),
    PeopleCall(
        "guest",
        ANYONE,
        "Sign a guest in with the secret of a guest link.",
        told.GuestResult,
        told.CodeRequest,
    ),
    _list("people", ADMINISTER, "All people.", told.PrincipalList),
    _list("devices", ADMINISTER, "All paired devices.", told.PrincipalList),
    _list("tokens", ADMINISTER, "All programs that have a token.", told.PrincipalList),
    _list("guests", ADMINISTER, "All guests.", told.PrincipalList),
    _list("sign-ins", ADMINISTER, "All sign-ins, the most recently used first.", told.SignInList),
    _list("pairings/{id}", SIGNED_IN, "State of a pairing.", told.PairingState),
    PeopleCall("people/add", ADMINISTER_FRESH, "Add a person.", ResultLine, told.AddPerson),
    PeopleCall(
        "people/invite",
        ADMINISTER_FRESH,
        "Create a link for a person to choose a passphrase.",
        told.SecretLink,
        told.PrincipalChoice,
    ),
    PeopleCall(
        "people/rename",
        ADMINISTER,
        "Rename a person, device, program or guest.",
        ResultLine,
        told.RenameRequest,
    ),
    PeopleCall(
        "people/roles",
        ADMINISTER_FRESH,
        "Replace the rights of a person, device or program.",
        ResultLine,
        told.RolesRequest,
    ),
    PeopleCall(
        "people/remove",
        ADMINISTER,
        "Remove a person, device, program or guest, with its sign-ins and devices.",
        ResultLine,
        told.PrincipalChoice,
    ),
    PeopleCall(
        "people/revoke",
        ADMINISTER,
        "End all sign-ins of a person, device, program or guest.",
        ResultLine,
        told.PrincipalChoice,
    ),
    PeopleCall(
        "devices/pair",
        ADMINISTER_FRESH,
        "Create a code that pairs one device.",
        told.PairingCode,
        told.PairingRequest,
    ),
    PeopleCall(
        "tokens/add",
        ADMINISTER_FRESH,
        "Add a program with a token.",
        told.NewToken,
        told.TokenRequest,
    ),
    PeopleCall(
        "guests/add",
        ADMINISTER_FRESH,
        "Create a link for guests to watch one robot.",
        told.SecretLink,
        told.GuestRequest,
    ),
    PeopleCall("sign-ins/end", ADMINISTER, "End one sign-in.", ResultLine, told.SignInChoice),
    _list("account", SIGNED_IN, "Your own account.", told.AccountInfo),
    PeopleCall(
        "account/passphrase",
        SIGNED_IN,
        "Change your own passphrase; all your other sign-ins end.",
        told.SignInResult,
        told.PassphraseRequest,
    ),
    PeopleCall(
        "account/devices/pair",
        SIGNED_IN_FRESH,
        "Create a code that pairs one of your devices.",
        told.PairingCode,
    ),
    PeopleCall(
        "account/devices/remove",
        SIGNED_IN,
        "Remove one of your devices.",
        ResultLine,
        told.PrincipalChoice,
    ),
    PeopleCall(
        "account/sign-ins/end",
        SIGNED_IN,
        "End one of your sign-ins.",
        ResultLine,
        told.SignInChoice,
    ),
)
"""All calls."""
