"""From what somebody asks for to what is put into the store."""

from collections.abc import Callable, Iterable, Sequence

from urc._phrases import joined, phrase
from urc.packages.index import Entry
from urc.packages.lock import Lock, lock_of
from urc.packages.names import Key, PackageError, Wish, parse_key
from urc.packages.plan import Plan
from urc.packages.resolver import choose, resolve
from urc.packages.signature import Signature
from urc.packages.sources import FileSource, Source, merged, offered
from urc.packages.store import Store
from urc.packages.versions import parse_range
from urc.shipped import shipped

__all__ = [
    "Plan",
    "check_names",
    "origin_lines",
    "plan_file",
    "plan_root",
    "plan_wish",
    "settle",
    "withdrawn_lines",
]

Found = dict[Key, list[tuple[Entry, Source]]]


def plan_wish(
    wish: Wish,
    sources: Sequence[Source],
    store: Store,
    complain: Callable[[str], None],
    pinned: Lock | None = None,
    *,
    takes_withdrawn: bool = False,
) -> Plan:
    """Return what a wish comes to, with all archives fetched.

    Args:
        wish: what is asked for.
        sources: in the order in which they are asked.
        store: what it has is not fetched again.
        complain: takes lines for people.
        pinned: these versions and bytes, and no others; also those that were withdrawn since.
        takes_withdrawn: what was withdrawn is taken like all others.

    Raises:
        PackageError: nobody has it, needs collide, or an archive is not what was promised.
    """
    everything = merged(sources, complain)
    found = everything
    if pinned is not None:
        found = _pinned(everything, pinned)
    elif not takes_withdrawn:
        found = offered(everything)
    try:
        root = choose({key: [entry for entry, _ in some] for key, some in found.items()}, wish)
        return plan_root(root, wish.range, found, store, pinned)
    except PackageError as error:
        if found is not everything and (told := _withdrawn(wish, everything)):
            raise PackageError(f"{error}; {told}") from None
        raise


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
        plan = plan_root(root, version, offered(merged([source, *others], complain)), store)
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
    remarks = {entry.sha256: said for entry in chosen.values() if (said := _remark(entry))}
    return Plan(lock, archives, origins, signatures, remarks=remarks)


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
    lines: list[str] = []
    for name, pin in plan.lock.packages.items():
        signature = plan.signatures.get(pin.sha256)
        who = phrase("not signed")
        if signature and keys.get(name) == signature.key:
            who = phrase("signed by {name}, as before", name=signature)
        elif signature:
            who = phrase("signed by {name}, a key seen for the first time", name=signature)
        names = {"package": f"{name} {pin.version}", "place": plan.origins[name], "who": who}
        line = phrase("{package}  from {place}, {who}", **names)
        if pin.sha256 not in plan.archives:
            line = phrase("{package}  from {place}, kept from before, {who}", **names)
        remark = plan.remarks.get(pin.sha256)
        lines.append(joined("; ", (line, remark)) if remark else line)
    return lines


def withdrawn_lines(lock: Lock, entries: Sequence[Entry]) -> list[str]:
    """Return for people what was withdrawn of an installed package, and why; one line each."""
    return [
        phrase("{package} was withdrawn: {why}", package=entry, why=entry.why_withdrawn)
        for name, pin in lock.packages.items()
        for entry in entries
        if entry.why_withdrawn and entry.sha256 == pin.sha256 and str(entry.key) == name
    ]


def _remark(entry: Entry) -> str:
    """Return what a repository says of a version beside the package itself."""
    said: list[str] = []
    if entry.why_withdrawn:
        said.append(phrase("WITHDRAWN: {why}", why=entry.why_withdrawn))
    return joined("; ", said + ([str(entry.provenance)] if entry.provenance else []))


def _withdrawn(wish: Wish, found: Found) -> str:
    """Return which versions that somebody may have meant were withdrawn, and why."""
    wanted = parse_range(wish.range)
    gone = [
        f"{entry} was withdrawn: {entry.why_withdrawn}"
        for key, some in found.items()
        for entry, _ in some
        if key.name == wish.name
        and wish.kind in ("", key.kind)
        and entry.why_withdrawn
        and wanted.allows(entry.number)
    ]
    return "; ".join([*gone[-3:], "--withdrawn takes it all the same"]) if gone else ""


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
