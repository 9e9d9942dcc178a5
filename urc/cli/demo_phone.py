"""Pairs a phone with `urc demo`, until the demo ends.

The phone belongs to a program of the data folder that represents the demo. The demo renews the
program's rights while it runs. The rights therefore also end soon after a demo that could not
remove the program: when it was killed, or when its terminal was closed.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Final

from urc.cli.identities import opened, record, roles_in
from urc.cli.output import complain
from urc.problems import UrcError

if TYPE_CHECKING:
    from urc.access.directory import Principal
    from urc.access.store import AccessStore

__all__ = ["NAME", "paired_until_end"]

NAME: Final = "urc demo"
"""Name of the owner; further demos of the same data folder append a number."""
_ROLES: Final = ("drive",)
_VALID_S: Final = 120.0
"""Time for which the owner's rights last without a renewal, in seconds."""
_RENEWAL_S: Final = 30.0


@contextmanager
def paired_until_end(address: str) -> Iterator["Principal"]:
    """Print a link and a QR code that pair one device; remove the device when the context ends.

    Args:
        address: address at which devices reach the server.

    Yields:
        The owner of the device.
    """
    from urc.cli.devices import invite_device

    with opened(None) as store:
        owner = _added(store)
        renewal = _Renewal(owner)
        try:
            with closing(renewal):
                invite_device(store, address.rstrip("/"), (), owner=owner)
                complain("the pairing ends with this demo")
                yield owner
        finally:
            _remove(store, owner)


def _added(store: "AccessStore") -> "Principal":
    """Add the owner under a free name, and remove the owners that ended demos have left."""
    now = time.time()
    with store.transaction():
        taken = set()
        for one in store.directory().principals.values():
            if one.kind != "program" or not one.name.casefold().startswith(NAME):
                continue
            if one.ends_at is not None and one.ends_at <= now:
                store.remove(one.id)
            else:
                taken.add(one.name.casefold())
        number, name = 1, NAME
        while name in taken:
            number += 1
            name = f"{NAME} {number}"
        return store.add("program", name, roles_in(_ROLES), now=now, ends_at=now + _VALID_S)


def _remove(store: "AccessStore", owner: "Principal") -> None:
    """Remove the owner with its devices and codes; after a failure, the rights expire."""
    try:
        store.remove(owner.id)
        record(store, "tokens remove", name=owner.name)
    except UrcError as error:
        complain(f"urc demo: {owner.name} was not removed: {error}")


class _Renewal:
    """A thread that renews the rights of a demo's owner until `close`."""

    def __init__(self, owner: "Principal") -> None:
        self._owner = owner
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="demo phone", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        with opened(None) as store:
            while not self._over.wait(_RENEWAL_S):
                try:
                    store.set_end(self._owner.id, time.time() + _VALID_S)
                except UrcError:
                    continue  # a busy file; the next renewal is in time

    def close(self) -> None:
        """End the renewals."""
        self._over.set()
        self._thread.join()
