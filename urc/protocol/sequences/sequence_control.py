"""Control of a running sequence: pause, single step, resume, abort.

Pure. Requests may arrive at any time. The sequence obeys between two steps, so that no step is
interrupted.
"""

from typing import Final, Literal

__all__ = ["PAUSE_S", "Pull", "SequenceControl"]

PAUSE_S: Final = 600.0
"""Longest pause, in seconds: a paused sequence blocks other sequences."""

Pull = Literal["pause", "step", "resume", "abort"]
"""A request of the operator. ``step`` runs one outermost step and pauses again. Before the start,
``step`` makes the sequence start paused."""


class SequenceControl:
    """The control state of one sequence, which runs once at a time."""

    __slots__ = ("_halt", "count", "is_aborted", "is_paused", "is_running", "of", "place", "reason")

    def __init__(self, of: int) -> None:
        """Initialise at rest; `of` is the number of outermost steps."""
        self.of = of
        self.place = 0
        """Number of started steps."""
        self.is_running = False
        self.is_paused = False
        self.is_aborted = False
        self.reason = ""
        """Reason of a failure; "" otherwise."""
        self.count = 0
        """Change counter of all attributes above."""
        self._halt: Literal["", "now", "next", "outer"] = ""
        """Place of the next pause. The value ``now`` means before any step, ``outer`` before an
        outermost one, and ``next`` after one more outermost step."""

    def pull(self, what: Pull) -> None:
        """Apply a request of the operator."""
        match what:
            case "pause":
                self._halt = "now" if self.is_running else ""
            case "step":
                self._halt = "next" if self.is_paused else "outer"
            case "resume":
                self._halt = ""
            case "abort":
                self._halt, self.is_aborted = "", self.is_running

    # -- for the runner

    def start(self) -> None:
        """Record the start."""
        self.place, self.reason = 0, ""
        self.is_running, self.is_paused, self.is_aborted = True, False, False
        self.count += 1

    def begin_step(self) -> None:
        """Record the start of another outermost step."""
        self.place += 1
        self.count += 1
        if self._halt == "next":
            self._halt = "outer"

    def end(self, reason: str) -> None:
        """Record the end."""
        self._halt, self.reason = "", reason
        self.is_running, self.is_paused, self.is_aborted = False, False, False
        self.count += 1

    def halts(self, *, is_outermost: bool) -> bool:
        """Return whether the next step must wait; if so, the sequence is paused."""
        is_over = is_outermost and self.place == self.of
        is_wanted = self._halt == "now" or (self._halt == "outer" and is_outermost)
        if is_over or not is_wanted:
            return False
        self.is_paused = True
        self.count += 1
        return True

    def goes_on(self) -> bool:
        """Return whether a pause has just ended."""
        if not self.is_paused or self._halt not in ("", "next"):
            return False
        self.is_paused = False
        self.count += 1
        return True
