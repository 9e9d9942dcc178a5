"""Times from revoking a right to the stop, for each kind of right that can end.

In a round of trials, all robots are driven in parallel, each by a different person, device or
program. This process then revokes the rights in the server's data folder, as ``urc people`` does,
while the pages continue to send ticks.
"""

import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from http.client import HTTPConnection
from pathlib import Path
from typing import Final, NamedTuple

from bench.rig.deaths import STOP_WITHIN_S, Rig, Trial
from urc.access.grants import Grant
from urc.access.store import AccessStore

__all__ = ["REVOKED_BOUND_MS", "REVOCATIONS", "RevocationRig"]

REVOCATIONS: Final = ("person", "device", "role", "token")
"""Ways to revoke a right: remove a person, remove a person's device, lower a role, or end a
token."""
REVOKED_BOUND_MS: Final = 300.0
"""Longest time from the revocation to the first byte of the stop, in milliseconds."""
_KNOWN_S: Final = 10.0


class _Holder(NamedTuple):
    """The holder of a right to drive one robot."""

    token: str
    cookie: str
    revoke: Callable[[], None]
    remove: tuple[str, ...]
    """Ids of the principals to remove after the trial."""


class RevocationRig(Rig):
    """A rig whose pages are signed in as people, devices and programs."""

    def __init__(self, folder: Path, *, robot_count: int = 20) -> None:
        """Start all programs; `folder` also contains the server's data."""
        super().__init__(folder, robot_count=robot_count)
        self._store = self._programs.enter_context(closing(AccessStore(folder / "data")))
        self._count = 0

    def bout(self, death: str) -> list[Trial]:
        """Drive each robot, revoke each right as `death` specifies, and return the results."""
        holders = {index: self._admitted(death) for index in self.indexes}
        for one in holders.values():
            self._await_known(one)
        began_ns = time.monotonic_ns()
        pages = {
            index: self.drive(
                index, "outside", 0.3 + self._dice.random() * 0.2, key=one.token, cookie=one.cookie
            )
            for index, one in holders.items()
        }
        for number in pages.values():
            self.operators.await_told("dying", number)
        trials = []
        for index, one in holders.items():
            asked_ns = time.monotonic_ns()
            one.revoke()
            # The right has ended when it is stored; how long the disk takes is not URC's.
            trials.append(self._trial(death, index, began_ns, (asked_ns, time.monotonic_ns())))
        for number in pages.values():
            self.operators.kill(number)
        for principal in {each for one in holders.values() for each in one.remove}:
            if principal in self._store.directory().principals:
                self._store.remove(principal)
        return trials

    def _admitted(self, kind: str) -> _Holder:
        """Return a new person, device or program with the right to drive."""
        self._count += 1
        name, now, store = f"{kind} {self._count}", time.time(), self._store
        drives = [Grant("drive")]
        if kind == "token":
            program = store.add("program", name, drives, now=now)
            sign_in, secret = store.open_sign_in(program.id, "token", now=now)
            return _Holder(secret, "", partial(store.close_sign_in, sign_in.id), (program.id,))
        person = store.add("person", name, drives, now=now)
        holder, revoke = person, partial(store.remove, person.id)
        if kind == "device":
            holder = store.add("device", name, now=now, owner=person.id)
            revoke = partial(store.remove, holder.id)
        elif kind == "role":
            revoke = partial(store.set_grants, person.id, [Grant("watch")])
        _, secret = store.open_sign_in(holder.id, "pairing", now=now)
        return _Holder("", f"urc-sign-in-{store.instance()}={secret}", revoke, (person.id,))

    def _await_known(self, holder: _Holder) -> None:
        """Wait until the server has read the new identity."""
        headers = {"Cookie": holder.cookie}
        if holder.token:
            headers = {"Authorization": f"Bearer {holder.token}"}
        end_s = time.monotonic() + _KNOWN_S
        while time.monotonic() < end_s:
            line = HTTPConnection(self.host, self.server.port, timeout=_KNOWN_S)
            line.request("GET", "/api/v1/robots/robot-0/controls", headers=headers)
            status = line.getresponse().status
            line.close()
            if status == 200:
                return
            time.sleep(0.02)
        raise AssertionError("the server does not know the new identity")

    def _trial(self, death: str, index: int, began_ns: int, span_ns: tuple[int, int]) -> Trial:
        """Return one robot's result: it must stop after the revocation and not move again.

        `span_ns` contains the times immediately before and after the revocation, in nanoseconds.
        """
        asked_ns, revoked_ns = span_ns
        before = [one for one in self.robots.since(index, began_ns) if one.time_ns <= asked_ns]
        if not before or before[-1].text == "M 0":  # a busy machine has delayed the page
            return Trial(death, float("inf"), "", 0.0, REVOKED_BOUND_MS, has_moved=False)

        def has_stopped() -> bool:
            heard = self.robots.since(index, began_ns)
            return bool(heard) and heard[-1].text == "M 0" and heard[-1].time_ns > asked_ns

        try:
            self.robots.wait_until(has_stopped, STOP_WITHIN_S, f"the stop of robot {index}")
        except AssertionError:
            return Trial(death, float("inf"), "no stop came", 0.0, REVOKED_BOUND_MS)
        time.sleep(0.1)  # the page still sends ticks, which must move nothing
        heard = self.robots.since(index, began_ns)
        moved = [place for place, one in enumerate(heard) if one.text != "M 0"]
        stop = next((one for one in heard[moved[-1] + 1 :] if one.text == "M 0"), None)
        if stop is None:
            fault = "the robot moved after the stop"
            return Trial(death, float("inf"), fault, 0.0, REVOKED_BOUND_MS)
        late_ms = self.late_ms(revoked_ns, stop.time_ns + 20_000_000)
        stop_ms = (stop.time_ns - revoked_ns) / 1e6
        return Trial(death, stop_ms, "", late_ms, REVOKED_BOUND_MS)
