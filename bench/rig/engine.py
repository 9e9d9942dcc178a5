"""Trials of stops after a server hangs or dies, or after one of its guards is killed."""

import os
import signal
import time

from bench.rig.deaths import Rig, Trial

__all__ = ["ENGINE_DEATHS", "RESTART_MS", "EngineRig"]

ENGINE_DEATHS = ("engine-stopped", "engine-killed", "engine-blocked")
RESTART_MS = 500.0
"""Time limit for replacing a killed guard, in ms; the new guard sends a stop first."""
OPEN_MS = 100.0
"""Additional time limit for the new guard's connection and the transfer of the stop, in ms."""
AGAIN_S = 10.0
BLOCKED_S = 30.0


class EngineRig(Rig):
    """A rig for driving robots while their server fails."""

    module = "bench.rig.server_process"

    def engine_bout(self, death: str) -> list[Trial]:
        """Drive every robot, then freeze, kill or block the server; return the results."""
        began_ns = time.monotonic_ns()
        pages = dict(self._begin("outside"))
        for number in pages.values():
            self.operators.await_told("dying", number)  # the page has driven, and continues
        told = len(self.server.lines)
        self._strike(death)
        heard = {index: self._await_stop(index, began_ns) for index in pages}
        watcher = self._watcher  # of the processes that failed: `_mend` may start others
        self._mend(death, told)
        trials = [
            self._judge(death, index, began_ns, heard[index], number, watcher)
            for index, number in pages.items()
        ]
        for number in pages.values():
            self.operators.kill(number)
        return trials

    def _strike(self, death: str) -> None:
        numbers = {
            "engine-stopped": signal.SIGSTOP,
            "engine-killed": signal.SIGKILL,
            "engine-blocked": signal.SIGUSR2,
        }
        self.server.signal(numbers[death])

    def _mend(self, death: str, told: int) -> None:
        if death == "engine-stopped":
            self.server.signal(signal.SIGCONT)
        elif death == "engine-blocked":
            self.server.wait_for("backtracked", BLOCKED_S, after=told)
        else:
            self.server.close()
            self.server = self._programs.enter_context(self._serve())
            self._watch()

    def guard_bout(self) -> list[Trial]:
        """Drive every robot, kill the guards one after another, and return the results."""
        began_ns = time.monotonic_ns()
        pages = dict(self._begin("outside"))
        for number in pages.values():
            self.operators.await_told("dying", number)
        trials = [trial for guard in self.server.guards for trial in self._kill(guard)]
        for number in pages.values():
            self.operators.kill(number)
        for index in pages:
            self._await_stop(index, began_ns)
        return trials

    def _kill(self, guard: int) -> list[Trial]:
        """Return one trial, or an empty list if a busy machine had already stopped the robot."""
        killed_ns = time.monotonic_ns()
        os.kill(guard, signal.SIGKILL)
        robots = self.robots
        indexes = range(len(robots.visits))

        def again() -> list[tuple[int, int]]:
            """Return the reconnected robots, with the times of their new connections."""
            return [
                (index, at)
                for index in indexes
                for at, is_open in robots.visits[index]
                if is_open and at > killed_ns and (robots.since(index, at) or not moved(index))
            ]

        def moved(index: int) -> bool:
            before = [one.text for one in robots.heard[index] if one.time_ns <= killed_ns]
            return before[-1:] != ["M 0"]

        robots.wait_until(lambda: bool(again()), AGAIN_S, "the replacement of the guard")
        index, opened_ns = again()[0]
        if not moved(index):
            return []
        first = robots.since(index, opened_ns)[0]
        fault = "" if first.text == "M 0" else f"{first.text} arrived before the stop"
        late_ms = self.late_ms(killed_ns, first.time_ns)
        took_ms = (first.time_ns - killed_ns) / 1e6
        return [Trial("guard-killed", took_ms, fault, late_ms, RESTART_MS + OPEN_MS)]
