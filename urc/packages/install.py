"""From what somebody asks for to what is put into the store."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from urc.packages.index import Entry
from urc.packages.lock import Lock, lock_of
from urc.packages.names import Key, PackageError, Wish, parse_key
from urc.packages.resolver import choose, resolve
from urc.packages.sources import FileSource, Source, merged
from urc.packages.store import Store
from urc.shipped import shipped

__all__ = ["Plan", "plan_file", "plan_wish"]

Found = dict[Key, list[tuple[Entry, Source]]]


class Plan(NamedTuple):
    """What would be installed."""

    lock: Lock
    archives: dict[str, bytes]
    """Digest → bytes of what the store has not."""
    origins: dict[str, str]
    """``drivers/puppet`` → where it comes from."""


def plan_wish(
    wish: Wish,
    sources: Sequence[Source],
    store: Store,
    complain: Callable[[str], None],
    pinned: Lock | None = None,
) -> Plan:
    """Return what a wish comes to, with all archives fetched.

    Args:
        wish: what is asked for.
        sources: in the order in which they are asked.
        store: what it has is not fetched again.
        complain: takes lines for people.
        pinned: these versions and bytes, and no others.

    Raises:
        PackageError: nobody has it, needs collide, or an archive is not what was promised.
    """
    found = merged(sources, complain)
    if pinned is not None:
        found = _pinned(found, pinned)
    root = choose({key: [entry for entry, _ in some] for key, some in found.items()}, wish)
    return _plan(root, wish.range, found, store, pinned)


def plan_file(
    source: FileSource, others: Sequence[Source], store: Store, complain: Callable[[str], None]
) -> Plan:
    """Return what the package in a file or folder comes to.

    The other sources are asked only for what it does not bring.
    """
    root = source.roots[0]
    own = merged([source], complain)
    try:
        # A version may be a pre-release: what somebody holds in hand is asked for as it is.
        return _plan(root, own[root][0][0].version, own, store, None)
    except PackageError:
        if not others:
            raise
    return _plan(root, own[root][0][0].version, merged([source, *others], complain), store, None)


def _plan(root: Key, wanted: str, found: Found, store: Store, pinned: Lock | None) -> Plan:
    chosen = resolve(
        root, wanted, {key: [entry for entry, _ in some] for key, some in found.items()}
    )
    lock = lock_of(root, chosen)
    if pinned is not None and lock != pinned:
        raise PackageError(f"{root}: what the lock names is not what it needs; make a new lock")
    for key in chosen:
        if key.kind == "widget" and (shipped("widgets") / key.name / "widget.yaml").is_file():
            raise PackageError(
                f"{key}: URC has a widget {key.name!r}, which no package may replace"
            )
    archives: dict[str, bytes] = {}
    origins: dict[str, str] = {}
    for key, entry in chosen.items():
        source = next(source for one, source in found[key] if one is entry)
        origins[str(key)] = source.name
        try:
            store.blob(entry.sha256)
        except PackageError:
            archives[entry.sha256] = source.fetch(entry)
    return Plan(lock, archives, origins)


def _pinned(found: Found, lock: Lock) -> Found:
    kept: Found = {}
    for text, pin in lock.packages.items():
        key = parse_key(text)
        kept[key] = [
            (entry, source)
            for entry, source in found.get(key, ())
            if (entry.version, entry.sha256, entry.size) == (pin.version, pin.sha256, pin.size)
        ]
        if not kept[key]:
            raise PackageError(f"{text} {pin.version}, with the bytes of the lock, is nowhere")
    return kept
