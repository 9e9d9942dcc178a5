"""The ledger of a fleet's authority: the certificates that it has issued.

Layer 4. Pure. The authority needs it to revoke all certificates of a site, and to accept each
invitation once.
"""

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Final, Self

import msgspec

from urc.fleet.certificates import SiteCertificate
from urc.fleet.names import FleetError

__all__ = ["Ledger", "LedgerEntry"]

_KEPT: Final = timedelta(days=30)
"""Time after its end for which a certificate stays in the ledger, in case a site's clock is behind.
"""


class LedgerEntry(msgspec.Struct, forbid_unknown_fields=True):
    """One issued certificate."""

    site: str
    serial: str
    """Serial number, hexadecimal."""
    ends: datetime
    is_invitation: bool = False
    used_by: str = ""
    """Hash of the public key for which an invitation was used; "" before."""
    is_withdrawn: bool = False
    """Whether a newer invitation has replaced this one."""


class Ledger(msgspec.Struct, forbid_unknown_fields=True):
    """All issued certificates, oldest first."""

    authority: str
    """Site of the authority."""
    entries: list[LedgerEntry] = []

    @classmethod
    def parse(cls, data: bytes) -> Self:
        """Return the ledger in `data`; raise `FleetError` if it is damaged."""
        try:
            return msgspec.json.decode(data, type=cls)
        except (msgspec.DecodeError, ValueError) as error:
            raise FleetError(f"damaged: {error}; restore it from a backup") from error

    def to_bytes(self) -> bytes:
        """Return the ledger as JSON."""
        return msgspec.json.encode(self)

    def add(self, certificate: SiteCertificate, now: datetime) -> None:
        """Add a certificate, and drop the ones that ended more than 30 days ago."""
        self.entries = [one for one in self.entries if now - one.ends < _KEPT]
        if self.entry(certificate) is None:
            self.entries.append(
                LedgerEntry(
                    certificate.site,
                    f"{certificate.serial:x}",
                    certificate.ends,
                    certificate.is_invitation,
                )
            )

    def entry(self, certificate: SiteCertificate) -> LedgerEntry | None:
        """Return the entry of a certificate."""
        serial = f"{certificate.serial:x}"
        return next((one for one in self.entries if one.serial == serial), None)

    def of_site(self, site: str) -> Iterator[LedgerEntry]:
        """Yield the entries of a site."""
        return (one for one in self.entries if one.site == site)

    def withdraw_invitations(self, site: str) -> None:
        """Make the unused invitations of a site invalid."""
        for one in self.of_site(site):
            if one.is_invitation and not one.used_by:
                one.is_withdrawn = True
