"""Passkeys: sign-in with a device's screen lock or a security key (WebAuthn level 3).

Layer 4. A browser offers passkeys only on a page with a host name, not an IP address, and only over
HTTPS or on ``localhost``. A passkey belongs to that host name, so a page on another host cannot
request it.

Theory of operation. Each ceremony has two requests. The response to the first request contains
options with a random challenge, which is valid for one use within five minutes. The second request
contains the authenticator's signature. The methods of `Passkeys` block for a few milliseconds
(SQLite, signatures), so servers call them in a thread. A lock protects the challenges from
simultaneous changes by several threads.
"""

import ipaddress
import json
import logging
import threading
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from urc.access.directory import Principal
from urc.access.grants import AccessError
from urc.access.passkey_table import Passkey, PasskeyTable, check_number
from urc.access.pending import Pending

if TYPE_CHECKING:
    from webauthn.helpers.structs import PublicKeyCredentialCreationOptions

__all__ = ["CHALLENGE_S", "Passkeys", "RelyingParty", "relying_party"]

CHALLENGE_S: Final = 300.0
"""Time limit for a ceremony and for the browser's dialog, in seconds."""
_NAME: Final = "URC"
_LOCAL: Final = "localhost"
_DEFAULT_PORTS: Final = {"http": 80, "https": 443}
_LONGEST_RESPONSE: Final = 65536
_REFUSED: Final = "the passkey was refused: sign in again, or in another way"
_LATE: Final = "the request took too long, or is already complete: try again"

log = logging.getLogger(__name__)


class RelyingParty(NamedTuple):
    """The host name and the origins under which browsers reach this server."""

    host: str
    """Host name to which passkeys belong (the RP ID)."""
    origins: tuple[str, ...]
    """Origins whose pages may request passkeys."""


class _Ceremony(NamedTuple):
    host: str
    principal: str
    """Id of the person adding a passkey; "" for a sign-in."""


def relying_party(host: str, port: int | None) -> RelyingParty:
    """Return the relying party for a request.

    Args:
        host: host in the request's ``Host`` header; an IPv6 address keeps its brackets.
        port: port in the ``Host`` header; None for the default port.

    Raises:
        AccessError: the host is an IP address.
    """
    name = host.lower().removesuffix(".")
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        pass
    else:
        raise AccessError(
            f"browsers do not offer passkeys for the address {name}:"
            " open this page by its host name"
        )
    schemes = ("https", "http") if name == _LOCAL or name.endswith(f".{_LOCAL}") else ("https",)
    return RelyingParty(name, tuple(_origin(scheme, name, port) for scheme in schemes))


class Passkeys:
    """One server's ceremonies."""

    def __init__(self, table: PasskeyTable, clock: Callable[[], float] = time.monotonic) -> None:
        """Initialize without pending challenges.

        Args:
            table: the registered passkeys.
            clock: function that returns monotonic time in seconds.
        """
        self.table = table
        self._clock = clock
        self._pending: Pending[_Ceremony] = Pending(CHALLENGE_S)
        self._lock = threading.Lock()

    # Adding a passkey

    def registration(self, owner: Principal, party: RelyingParty, place: str) -> dict[str, Any]:
        """Return the options for ``navigator.credentials.create``, in the JSON form of WebAuthn.

        Args:
            owner: the signed-in person.
            party: this server.
            place: network address that the request came from.

        Raises:
            AccessError: the person has too many passkeys.
        """
        from webauthn import generate_registration_options
        from webauthn.helpers.structs import (
            AuthenticatorSelectionCriteria,
            PublicKeyCredentialDescriptor,
            ResidentKeyRequirement,
            UserVerificationRequirement,
        )

        passkeys = self.table.of(owner.id)
        check_number(len(passkeys))  # before the authenticator creates a passkey
        known = [each for each in passkeys if each.host == party.host]
        options = generate_registration_options(
            rp_id=party.host,
            rp_name=_NAME,
            # The id is random, so the passkey reveals no name to other websites.
            user_id=owner.id.encode(),
            user_name=owner.name,
            challenge=_bytes(self._begin(_Ceremony(party.host, owner.id), place)),
            timeout=round(CHALLENGE_S * 1000),
            authenticator_selection=AuthenticatorSelectionCriteria(
                # The sign-in page requests no name, so the authenticator must store the passkey.
                resident_key=ResidentKeyRequirement.REQUIRED,
                user_verification=UserVerificationRequirement.PREFERRED,
            ),
            exclude_credentials=[PublicKeyCredentialDescriptor(_bytes(each.id)) for each in known],
        )
        return _as_json(options)

    def register(
        self, owner: Principal, party: RelyingParty, response: object, name: str, now: float
    ) -> Passkey:
        """Add a passkey that a browser has created.

        Args:
            owner: the signed-in person who requested the options.
            party: this server.
            response: the result of ``navigator.credentials.create``, as JSON.
            name: the passkey's display name.
            now: UTC time in seconds since 1970.

        Raises:
            AccessError: the response is invalid or too late, or the passkey cannot be added.
        """
        from webauthn import verify_registration_response
        from webauthn.helpers import bytes_to_base64url

        answer = _checked(response)
        challenge = self._finish(answer, _Ceremony(party.host, owner.id))
        made = _verified(
            verify_registration_response,
            credential=answer,
            expected_challenge=_bytes(challenge),
            expected_rp_id=party.host,
            expected_origin=list(party.origins),
        )
        return self.table.add(
            Passkey(
                bytes_to_base64url(made.credential_id), owner.id, name, party.host,
                made.credential_public_key, made.sign_count, now, now,
            )
        )  # fmt: skip

    # Signing in

    def authentication(self, party: RelyingParty, place: str) -> dict[str, Any]:
        """Return the options for ``navigator.credentials.get``, in the JSON form of WebAuthn.

        Args:
            party: this server.
            place: network address that the request came from.
        """
        from webauthn import generate_authentication_options
        from webauthn.helpers.structs import UserVerificationRequirement

        options = generate_authentication_options(
            rp_id=party.host,
            challenge=_bytes(self._begin(_Ceremony(party.host, ""), place)),
            timeout=round(CHALLENGE_S * 1000),
            user_verification=UserVerificationRequirement.PREFERRED,
        )
        return _as_json(options)

    def authenticate(self, party: RelyingParty, response: object, now: float) -> Passkey:
        """Return the passkey that signed one of this server's challenges.

        Args:
            party: this server.
            response: the result of ``navigator.credentials.get``, as JSON.
            now: UTC time in seconds since 1970.

        Raises:
            AccessError: the response is invalid or too late, the passkey is unknown, or its counter
                did not increase.
        """
        from webauthn import verify_authentication_response

        answer = _checked(response)
        challenge = self._finish(answer, _Ceremony(party.host, ""))
        passkey = self.table.find(str(answer.get("id")))
        if passkey is None or passkey.host != party.host:
            raise AccessError("this server does not know the passkey: it may have been removed")
        if _owner_of(answer) not in ("", passkey.principal):
            raise AccessError(_REFUSED)
        proof = _verified(
            verify_authentication_response,
            credential=answer,
            expected_challenge=_bytes(challenge),
            expected_rp_id=party.host,
            expected_origin=list(party.origins),
            credential_public_key=passkey.public_key,
            # The counter is compared below, for a specific error message.
            credential_current_sign_count=0,
        )
        if passkey.counter and proof.new_sign_count <= passkey.counter:
            log.warning(
                "the counter of the passkey %r did not increase: the passkey may have been copied",
                passkey.name,
            )
            raise AccessError(
                "the passkey may have been copied: its counter did not increase. Use another way to"
                " sign in, and replace the passkey"
            )
        self.table.used(passkey.id, proof.new_sign_count, now)
        return passkey._replace(counter=proof.new_sign_count, used_at=now)

    # Challenges

    def _begin(self, ceremony: _Ceremony, place: str) -> str:
        with self._lock:
            return self._pending.begin(ceremony, place, self._clock())

    def _finish(self, answer: Mapping[str, Any], expected: _Ceremony) -> str:
        """Use up and return the challenge in a response; raise `AccessError` if it is unknown."""
        challenge = _challenge_of(answer)
        with self._lock:
            found = self._pending.finish(challenge, self._clock())
        if found != expected:
            raise AccessError(_LATE)
        return challenge


def _checked(response: object) -> dict[str, Any]:
    if not isinstance(response, dict) or len(json.dumps(response)) > _LONGEST_RESPONSE:
        raise AccessError(_REFUSED)
    return response


def _challenge_of(answer: Mapping[str, Any]) -> str:
    """Return the signed challenge as text; "" if the response contains no challenge."""
    try:
        data = json.loads(_bytes(answer["response"]["clientDataJSON"]))
        # A page in another site's frame must not use this server's passkeys.
        return "" if data.get("crossOrigin") else str(data["challenge"])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return ""


def _owner_of(answer: Mapping[str, Any]) -> str:
    """Return the owner's id from the response; "" if there is no id, "?" if it is invalid."""
    try:
        return _bytes(answer["response"].get("userHandle") or "").decode()
    except (ValueError, KeyError, TypeError, AttributeError):
        return "?"


def _verified(verify: Callable[..., Any], **given: Any) -> Any:
    """Return the result of the library's check; raise `AccessError` if the check fails."""
    try:
        return verify(**given)
    except Exception as error:
        # The library does not catch errors from its parsers, such as KeyError and struct.error.
        log.info("refused a passkey: %s", error)
        raise AccessError(_REFUSED) from None


def _as_json(options: "PublicKeyCredentialCreationOptions | Any") -> dict[str, Any]:
    from webauthn.helpers import options_to_json_dict

    return options_to_json_dict(options)


def _bytes(text: str) -> bytes:
    from webauthn.helpers import base64url_to_bytes

    return base64url_to_bytes(text)


def _origin(scheme: str, name: str, port: int | None) -> str:
    """Return an origin as browsers write it, without a default port."""
    is_default = port in (None, _DEFAULT_PORTS[scheme])
    return f"{scheme}://{name}" if is_default else f"{scheme}://{name}:{port}"
