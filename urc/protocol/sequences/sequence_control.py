"""Control of a running sequence: pause, single step, resume and abort.

Pure. Control requests may arrive at any time. The requests take effect between two steps, so no
step is interrupted.
"""

from typing import Final, Literal

__all__ = ["PAUSE_S", "Pull", "SequenceControl"]

PAUSE_S: Final = 600.0
"""Maximum duration of a pause, in seconds. Pauses are limited because a paused sequence blocks
other sequences."""

Pull = Literal["pause", "step", "resume", "abort"]
"""A control request from the operator. On a paused sequence, ``step`` runs one outermost step and
pauses again. On any other sequence, ``step`` causes a pause before the next outermost step, which
may be the first."""


class SequenceControl:
    """The control state of one sequence, for at most one run at a time."""

    __slots__ = ("_halt", "count", "is_aborted", "is_paused", "is_running", "of", "place", "reason")

    def __init__(self, of: int) -> None:
        """Create the state of an idle sequence with `of` outermost steps."""
        self.of = of
        self.place = 0
        """Number of outermost steps that have started."""
        self.is_running = False
        self.is_paused = False
        self.is_aborted = False
        self.reason = ""
        """Reason why the last run failed; "" if it did not fail."""
        self.count = 0
        """Number of changes to the public attributes so far, from which readers detect a change."""
        self._halt: Literal["", "now", "next", "outer"] = ""
        """Next pause: before any step (``now``), before the next outermost step (``outer``), after
        one more outermost step (``next``), or "" for none."""

    def pull(self, what: Pull) -> None:
        """Apply a control request from the operator."""
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
        """Record the start of a sequence run."""
        self.place, self.reason = 0, ""
        self.is_running, self.is_paused, self.is_aborted = True, False, False
        self.count += 1

    def begin_step(self) -> None:
        """Record the start of the next outermost step."""
        self.place += 1
        self.count += 1
        if self._halt == "next":
            self._halt = "outer"

    def end(self, reason: str) -> None:
        """Record the end of a sequence run."""
        self._halt, self.reason = "", reason
        self.is_running, self.is_paused, self.is_aborted = False, False, False
        self.count += 1

    def halts(self, *, is_outermost: bool) -> bool:
        """Return whether the next step must wait; if so, mark the sequence as paused."""
        is_over = is_outermost and self.place == self.of
        is_wanted = self._halt == "now" or (self._halt == "outer" and is_outermost)
        if is_over or not is_wanted:
            return False
        self.is_paused = True
        self.count += 1
        return True

    def goes_on(self) -> bool:
        """Return whether a pause must end; if so, mark the sequence as running."""
        if not self.is_paused or self._halt not in ("", "next"):
            return False
        self.is_paused = False
        self.count += 1
        return True
