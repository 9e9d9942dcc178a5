"""From what somebody asks for to what is put into the store."""

from collections.abc import Callable, Iterable, Sequence

from urc.packages.index import Entry
from urc.packages.lock import Lock, lock_of
from urc.packages.names import Key, PackageError, Wish, parse_key
from urc.packages.plan import Plan
from urc.packages.resolver import choose, resolve
from urc.packages.signature import Signature
from urc.packages.sources import FileSource, Source, merged
from urc.packages.store import Store
from urc.shipped import shipped

__all__ = ["Plan", "check_names", "origin_lines", "plan_file", "plan_root", "plan_wish", "settle"]

Found = dict[Key, list[tuple[Entry, Source]]]


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
    return plan_root(root, wish.range, found, store, pinned)


def plan_file(
    source: FileSource, others: Sequence[Source], store: Store, complain: Callable[[str], None]
) -> Plan:
    """Return what the package in a file or folder comes to.

    The other sources are asked only for what it does not bring.
    """
    root = source.roots[0]
    own = merged([source], complain)
    # A version may be a pre-release: what somebody holds in hand is asked for as it is.
    version = own[root][0][0].version
    try:
        plan = plan_root(root, version, own, store)
    except PackageError:
        if not others:
            raise
        plan = plan_root(root, version, merged([source, *others], complain), store)
    if not source.is_folder:
        return plan
    names = (name for name, origin in plan.origins.items() if origin == source.name)
    return plan._replace(own=frozenset(names))


def plan_root(
    root: Key, wanted: str, found: Found, store: Store, pinned: Lock | None = None
) -> Plan:
    """Return what one package comes to, with all archives fetched.

    Args:
        root: which.
        wanted: range of its versions.
        found: what there is, as `merged` returns it.
        store: what it has is not fetched again.
        pinned: what must come of it.

    Raises:
        PackageError: as `plan_wish`.
    """
    chosen = settle(root, wanted, found)
    lock = lock_of(root, chosen)
    if pinned is not None and lock != pinned:
        raise PackageError(f"{root}: what the lock names is not what it needs; make a new lock")
    check_names(chosen)
    archives: dict[str, bytes] = {}
    origins: dict[str, str] = {}
    signatures: dict[str, Signature] = {}
    for key, entry in chosen.items():
        source = next(source for one, source in found[key] if one is entry)
        origins[str(key)] = source.name
        if signature := entry.signed or store.signature(entry.sha256):
            signatures[entry.sha256] = signature
        try:
            store.blob(entry.sha256)
        except PackageError:
            archives[entry.sha256] = source.fetch(entry)
    return Plan(lock, archives, origins, signatures)


def settle(root: Key, wanted: str, found: Found) -> dict[Key, Entry]:
    """Return which versions are taken; nothing is fetched. Raise `PackageError`."""
    return resolve(root, wanted, {key: [entry for entry, _ in some] for key, some in found.items()})


def check_names(chosen: Iterable[Key]) -> None:
    """Raise `PackageError` for a widget that would stand in for one of URC's own."""
    for key in chosen:
        if key.kind == "widget" and (shipped("widgets") / key.name / "widget.yaml").is_file():
            raise PackageError(
                f"{key}: URC has a widget {key.name!r}, which no package may replace"
            )


def origin_lines(plan: Plan, store: Store) -> list[str]:
    """Return for people, one line for each package: where it comes from, and who signed it."""
    keys = store.state().keys
    lines = []
    for name, pin in plan.lock.packages.items():
        signature = plan.signatures.get(pin.sha256)
        who = f"signed by {signature}" if signature else "not signed"
        if signature and keys.get(name) == signature.key:
            who += ", as before"
        elif signature:
            who += ", a key seen for the first time"
        kept = "" if pin.sha256 in plan.archives else ", kept from before"
        lines.append(f"{name} {pin.version}  from {plan.origins[name]}{kept}, {who}")
    return lines


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
