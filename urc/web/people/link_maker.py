"""The maker of links for other devices: codes of pairings and invitations, and guest links.

Layer 5. Its methods block: they read files.
"""

from pathlib import Path

from starlette.requests import Request

from urc.access.lifetimes import PAIRING_S
from urc.access.store import Invitation
from urc.web.people.browser_sign_ins import BrowserSignIns
from urc.web.people.messages import PairingCode, SecretLink
from urc.web.people.pairings import Pairings
from urc.web.people.public_address import (
    authority_fingerprint,
    is_reachable,
    public_address,
    qr_image,
)

__all__ = ["LinkMaker"]


class LinkMaker:
    """The links of one server."""

    def __init__(self, sign_ins: BrowserSignIns, pairings: Pairings, data: Path | None) -> None:
        """Prepare.

        Args:
            sign_ins: the sign-ins of all browsers.
            pairings: the codes that administrators wait for.
            data: the data folder; None without one.
        """
        self._sign_ins = sign_ins
        self._pairings = pairings
        self._data = data

    def link(self, request: Request, page: str, secret: str, ends_at: float) -> SecretLink:
        """Return the link of a secret.

        Args:
            request: the administrator's request.
            page: page of the link, such as ``join``.
            secret: the secret, which is only in the fragment.
            ends_at: UTC time of the end, in seconds since 1970.
        """
        address = public_address(request, self._data, self._sign_ins.access.instance)
        text = f"{address}/{page}#{secret}"
        return SecretLink(text, qr_image(text), ends_at, is_reachable(address))

    def pairing(self, request: Request, invitation: Invitation) -> PairingCode:
        """Return a new code that pairs one device within two minutes.

        Args:
            request: the administrator's request.
            invitation: name, owner and rights of the device.

        Raises:
            AccessError: too many codes are valid.
        """
        now = self._sign_ins.control.now()
        ends_at = now + PAIRING_S
        code = self._sign_ins.store.invite(invitation._replace(ends_at=ends_at), now=now)
        made = self.link(request, "pair", code, ends_at)
        return PairingCode(
            id=self._pairings.add(code, ends_at),
            link=made.link,
            qr=made.qr,
            code=code,
            fingerprint=authority_fingerprint(self._data),
            is_reachable=made.is_reachable,
            lasts_s=PAIRING_S,
        )
