"""Any order of invitations, copies of codes, lost replies, revocations, restores and days.

Hypothesis looks for an order in which a revoked certificate works again, two computers become one
site, or a number of the revocation list falls.
"""

from contextlib import suppress
from datetime import timedelta
from pathlib import Path
from shutil import copytree, rmtree
from tempfile import mkdtemp

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from tests.unit.fleet.fleets import ADDRESS, NOW, Place
from urc.fleet.files import AUTHORITY_FOLDER
from urc.fleet.invitation import SiteInvitation
from urc.fleet.joining import join, renew_own
from urc.fleet.membership import Membership
from urc.fleet.names import FleetError

SITES = st.sampled_from(["hall", "store"])
COMPUTERS = st.sampled_from(["first", "second"])


class FleetMachine(RuleBasedStateMachine):
    """One authority and two computers, each of which may be any site."""

    def __init__(self) -> None:
        super().__init__()
        self.place = Place(Path(mkdtemp()))
        self.now = NOW
        self.codes: dict[str, str] = {}
        self.revoked: set[int] = set()
        self.number = 0
        self.backup: Path | None = None

    def teardown(self) -> None:
        rmtree(self.place.folder)

    def computer(self, name: str) -> Membership | None:
        try:
            return Membership.load(self.place.folder / name)
        except FleetError:
            return None

    @rule(site=SITES)
    def invite(self, site: str) -> None:
        with suppress(FleetError):  # already a member
            self.codes[site] = self.place.authority.invite(site, [ADDRESS], self.now).code()

    @rule(site=SITES, computer=COMPUTERS, is_lost=st.booleans())
    def join(self, site: str, computer: str, is_lost: bool) -> None:
        """Join with the newest code, which another computer may have used before."""
        if site not in self.codes:
            self.invite(site)
        with suppress(FleetError):  # the code has ended, or the computer is another site
            join(self.place.folder / computer, SiteInvitation.parse(self.codes[site]), self.now)
        self.renew(computer, is_lost)

    @rule(computer=COMPUTERS, is_lost=st.booleans())
    def renew(self, computer: str, is_lost: bool) -> None:
        own = self.computer(computer)
        if own is None:
            return
        asked = own.renewal()
        try:
            chain = self.place.authority.renew(asked, own.certificate, self.now)
        except FleetError:
            return
        assert own.certificate.serial not in self.revoked
        if not is_lost:
            own.renewed(chain, self.now).check(self.now)

    @rule(site=SITES)
    def revoke(self, site: str) -> None:
        try:
            listed = self.place.authority.revoke(site, self.now)
        except FleetError:  # never invited
            return
        self.place.office.take_revocations(self.place.authority.signed_revocations())
        self.revoked |= listed.serials[site]

    @rule(days=st.sampled_from([0.5, 3.0, 8.0]))
    def wait(self, days: float) -> None:
        self.now += timedelta(days=days)
        self.place.office = renew_own(self.place.authority, self.place.office, self.now)

    @rule()
    def back_up(self) -> None:
        self.backup = Path(mkdtemp(dir=self.place.folder)) / AUTHORITY_FOLDER
        copytree(self.place.authority.folder, self.backup)

    @precondition(lambda self: self.backup is not None)
    @rule()
    def restore(self) -> None:
        """Only the list of revocations: a restored ledger may accept an invitation again."""
        assert self.backup is not None
        old = (self.backup / "revoked.json").read_bytes()
        (self.place.authority.folder / "revoked.json").write_bytes(old)
        if known := self.place.office.signed_revocations():
            self.place.authority.merge_revocations(known)
        self.place.office.take_revocations(self.place.authority.signed_revocations())

    @invariant()
    def revoked_certificates_stay_revoked(self) -> None:
        known = self.place.office.revocations()
        for listed in (known, self.place.authority.revocations()):
            assert all(listed.revokes(serial) for serial in self.revoked)
        assert known.number >= self.number
        self.number = known.number

    @invariant()
    def one_computer_is_one_site(self) -> None:
        sites = []
        for name in ("first", "second"):
            own = self.computer(name)
            try:
                if own is not None:
                    sites.append(self.place.office.peer(own.certificate.pem, self.now).site)
            except FleetError:
                continue
        assert len(sites) == len(set(sites)), sites


TestFleetMachine = FleetMachine.TestCase
TestFleetMachine.settings = settings(max_examples=25, stateful_step_count=25, deadline=None)
