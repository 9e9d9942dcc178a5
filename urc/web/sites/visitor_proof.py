"""The header by which another site knows who acts: an assertion that this site signs.

Layer 5. The header begins a visit in this site's audit log, or continues it.
"""

from dataclasses import replace
from typing import Protocol

from urc.fleet.assertion import SCHEME, Assertion
from urc.web.serve.visitor import Visitor
from urc.web.sites.robot_names import FarName
from urc.web.sites.visit_log import VisitLog

__all__ = ["SignsAssertions", "VisitorProofs"]


class SignsAssertions(Protocol):
    """The membership of this site."""

    def asserted(self, assertion: Assertion, site: str) -> str:
        """Return an assertion for another site, signed by this site."""


class VisitorProofs:
    """Makes the header for each request to another site."""

    def __init__(self, signer: SignsAssertions, begun: VisitLog) -> None:
        """Create the object.

        Args:
            signer: the membership of this site.
            begun: identifiers of visits, and the audit log of this site.
        """
        self._signer = signer
        self._begun = begun

    def header(self, visitor: Visitor, place: str, far: FarName) -> tuple[bytes, bytes] | None:
        """Return the header with a visitor's assertion; None for a visitor without a role.

        Args:
            visitor: the visitor.
            place: network address of the visitor.
            far: the robot.
        """
        role = visitor.role(str(far))
        if role is None:
            return None
        if not visitor.may_give(""):
            role = "watch"  # an assertion has no list of commands: a limited token may only watch
        who = visitor.identity
        assertion = Assertion(
            principal=who.principal or "visitor",
            name=who.name or place,
            kind=who.kind or "guest",
            sign_in=who.sign_in or place or "visitor",
            robot=far.robot,
            role=role,
            place=place,
        )
        visit = self._begun.sent(assertion, far, "key" if visitor.is_local else who.way)
        signed = self._signer.asserted(replace(assertion, visit=visit), far.site)
        return b"authorization", f"{SCHEME} {signed}".encode()
