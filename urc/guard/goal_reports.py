"""The reports of a robot's transports about ROS goals and their cancellations.

A command is complete before its cancellation has left the guard. A report from before the command
therefore proves nothing, and each answer refers to a number of reports.
"""

from collections.abc import Collection
from typing import Literal

from urc.transports.base import GoalRecord

__all__ = ["GoalAnswer", "GoalReports"]

GoalAnswer = Literal["unsent", "owed", "dropped", "answered"]
"""State of a cancellation: not reported yet, not answered yet, ended without an answer, or
answered."""


class GoalReports:
    """The newest report of each transport."""

    def __init__(self, lines: Collection[str]) -> None:
        """Start without reports; `lines` names the transports that report goals."""
        self.number = 0
        """Number of reports so far."""
        self._lines = frozenset(lines)
        self._records: dict[str, GoalRecord] = {}
        self._owed: dict[tuple[str, str], int] = {}
        """Number of the newest report of each unanswered cancellation, keyed by line and action."""

    def changed(self, line: str, record: GoalRecord) -> None:
        """Take a report."""
        self.number += 1
        self._records[line] = record
        for action in record.owed:
            self._owed[line, action] = self.number

    def record(self, line: str) -> GoalRecord | None:
        """Return the newest report of a transport; None before the first."""
        return self._records.get(line)

    def answer(self, line: str, action: str, since: int) -> GoalAnswer:
        """Return the state of a cancellation.

        Args:
            line: name of the transport.
            action: the action whose goals are cancelled.
            since: `number` before the cancellation was sent.
        """
        if line not in self._lines:
            return "answered"
        if self._owed.get((line, action), 0) <= since:
            return "unsent"
        record = self._records[line]
        if action in record.owed:
            return "owed"
        return "dropped" if action in record.dropped else "answered"

    def end(self, actions: Collection[str]) -> list[str]:
        """Take unanswered cancellations as dropped; return the transports that have any.

        Args:
            actions: the actions whose cancellations end.
        """
        lines = []
        for line, record in tuple(self._records.items()):
            ended = [one for one in record.owed if one in actions]
            if ended:
                lines.append(line)
                owed = tuple(one for one in record.owed if one not in actions)
                dropped = tuple(dict.fromkeys((*record.dropped, *ended)))
                self.changed(line, record._replace(owed=owed, dropped=dropped))
        return lines
