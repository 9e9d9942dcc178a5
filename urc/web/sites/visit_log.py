"""Visits in the audit logs of both sites, under one identifier.

Layer 5. The visitor's site chooses the identifier when a visit begins, and sends it with each
assertion. Both sites record the visit; the robot's site also records each change of the role.
"""

import secrets
from collections import OrderedDict
from collections.abc import Callable

from urc.access.visits import MAX_VISITS, Visit
from urc.fleet.assertion import LASTS_S, Assertion
from urc.runtime.server_recorder import Actor, ServerRecorder
from urc.web.sites.robot_names import FarName

__all__ = ["VisitLog"]

_Key = tuple[str, str, str]


class VisitLog:
    """The visits that were recorded; above `MAX_VISITS`, the oldest are forgotten."""

    def __init__(self, utc: Callable[[], float]) -> None:
        """Record nothing until `recorder` is set; `utc` returns UTC time in seconds since 1970."""
        self.recorder: ServerRecorder | None = None
        """Audit log of this site."""
        self._utc = utc
        self._sent: OrderedDict[_Key, tuple[str, float]] = OrderedDict()
        self._received: OrderedDict[_Key, Visit] = OrderedDict()

    def sent(self, assertion: Assertion, far: FarName, way: str) -> str:
        """Return the identifier of a visit that goes out, and record a new visit.

        A visit ends when no assertion was sent for as long as the last one was valid.

        Args:
            assertion: the visitor.
            far: the robot and its site.
            way: the visitor's sign-in method.
        """
        key, now = (far.site, assertion.sign_in, far.robot), self._utc()
        kept = self._sent.pop(key, None)
        is_new = kept is None or not 0 <= now - kept[1] <= LASTS_S
        visit = secrets.token_urlsafe(9) if kept is None or is_new else kept[0]
        self._sent[key] = visit, now
        if len(self._sent) > MAX_VISITS:
            self._sent.popitem(last=False)
        if is_new and self.recorder is not None:
            actor = Actor(
                *(assertion.name, assertion.principal, assertion.kind, assertion.role, way),
                assertion.place,
            )
            self.recorder.visited(actor, str(far), far.site, visit, "visits the other site")
        return visit

    def received(self, visit: Visit) -> None:
        """Record a visit from another site if it is new, or if its role has changed."""
        key = (visit.site, visit.sign_in, visit.robot)
        kept = self._received.pop(key, None)
        self._received[key] = visit
        if len(self._received) > MAX_VISITS:
            self._received.popitem(last=False)
        if kept is not None and (kept.id, kept.role) == (visit.id, visit.role):
            return
        if self.recorder is not None:
            actor = Actor(
                *(f"{visit.name} ({visit.site})", f"{visit.site}/{visit.principal}", visit.kind),
                *(visit.role or "", "site", visit.place),
            )
            outcome = visit.limit or "admitted"
            self.recorder.visited(actor, visit.robot, visit.site, visit.id, outcome)
