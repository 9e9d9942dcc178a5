"""Where a sequence stands, and what people want of it: pause, one more step, go on, end.

Floor 3, pure. People pull at any time; the sequence obeys between two of its steps, so that what
one step has begun is never left in the middle.
"""

from typing import Final, Literal

__all__ = ["PAUSE_S", "Pull", "Reins"]

PAUSE_S: Final = 600.0
"""A sequence that is paused for longer ends: it keeps others from running."""

Pull = Literal["pause", "step", "resume", "abort"]
"""``step``: one step of the outermost ones, and pause again; told before it begins, it begins
paused."""


class Reins:
    """Of one sequence, which runs once at a time."""

    __slots__ = ("_halt", "count", "is_aborted", "is_paused", "is_running", "of", "place", "reason")

    def __init__(self, of: int) -> None:
        """Begin at rest; `of` is how many steps it has, without those inside of others."""
        self.of = of
        self.place = 0
        """Steps that were begun."""
        self.is_running = False
        self.is_paused = False
        self.is_aborted = False
        self.reason = ""
        """Why it ended without success; "" when it did not."""
        self.count = 0
        """Grows with each change of the above."""
        self._halt: Literal["", "now", "next", "outer"] = ""
        """now: before any step; outer: before an outermost one; next: after one more of those."""

    def pull(self, what: Pull) -> None:
        """Take what somebody wants."""
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

    def begin(self) -> None:
        """Take note that it begins."""
        self.place, self.reason = 0, ""
        self.is_running, self.is_paused, self.is_aborted = True, False, False
        self.count += 1

    def step(self) -> None:
        """Take note that one more of the outermost steps begins."""
        self.place += 1
        self.count += 1
        if self._halt == "next":
            self._halt = "outer"

    def end(self, reason: str) -> None:
        """Take note that it is over."""
        self._halt, self.reason = "", reason
        self.is_running, self.is_paused, self.is_aborted = False, False, False
        self.count += 1

    def halts(self, *, is_outermost: bool) -> bool:
        """Return whether the next step must wait; from then on it is paused."""
        is_over = is_outermost and self.place == self.of
        is_wanted = self._halt == "now" or (self._halt == "outer" and is_outermost)
        if is_over or not is_wanted:
            return False
        self.is_paused = True
        self.count += 1
        return True

    def goes_on(self) -> bool:
        """Return whether it was paused, and is not any more."""
        if not self.is_paused or self._halt not in ("", "next"):
            return False
        self.is_paused = False
        self.count += 1
        return True
