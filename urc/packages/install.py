"""Install plans for the packages that users request."""

from collections.abc import Callable, Iterable, Sequence

from urc._translatable import joined, phrase
from urc.packages.index import IndexEntry
from urc.packages.install_plan import InstallPlan
from urc.packages.lock import Lock, lock_of
from urc.packages.names import PackageError, PackageId, PackageRequirement, parse_key
from urc.packages.resolver import choose, resolve
from urc.packages.signature import Signature
from urc.packages.sources import FileSource, Source, merged, offered
from urc.packages.store import Store
from urc.packages.versions import parse_range
from urc.shipped import shipped

__all__ = [
    "InstallPlan",
    "check_names",
    "origin_lines",
    "plan_file",
    "plan_root",
    "plan_requirement",
    "settle",
    "without_blocked",
    "withdrawn_lines",
]

Found = dict[PackageId, list[tuple[IndexEntry, Source]]]


def plan_requirement(
    required: PackageRequirement,
    sources: Sequence[Source],
    store: Store,
    complain: Callable[[str], None],
    pinned: Lock | None = None,
    *,
    takes_withdrawn: bool = False,
) -> InstallPlan:
    """Return the install plan for a requirement, with all archives.

    Args:
        required: the requirement.
        sources: package sources, in the order in which they are queried.
        store: store whose archives need no download.
        complain: callback that receives warnings for the user.
        pinned: lock with the only accepted versions and digests, even if a version was withdrawn
            later.
        takes_withdrawn: whether withdrawn versions are accepted.

    Raises:
        PackageError: no source has the package, its dependencies conflict, or an archive differs
            from the index.
    """
    everything = merged(sources, complain)
    found = everything
    if pinned is not None:
        found = _pinned(everything, pinned)
    else:
        found = without_blocked(everything if takes_withdrawn else offered(everything), store)
    try:
        root = choose({key: [entry for entry, _ in some] for key, some in found.items()}, required)
        return plan_root(root, required.range, found, store, pinned)
    except PackageError as error:
        if found is not everything and (told := _left_out(required, everything, store)):
            raise PackageError(f"{error}; {told}") from None
        raise


def plan_file(
    source: FileSource, others: Sequence[Source], store: Store, complain: Callable[[str], None]
) -> InstallPlan:
    """Return the install plan for the package in a file or folder.

    Other sources are used only for missing dependencies.
    """
    root = source.roots[0]
    own = merged([source], complain)
    # Require the exact version, so that a pre-release in a user's own file is accepted.
    version = own[root][0][0].version
    try:
        plan = plan_root(root, version, own, store)
    except PackageError:
        if not others:
            raise
        found = without_blocked(offered(merged([source, *others], complain)), store)
        plan = plan_root(root, version, found, store)
    if not source.is_folder:
        return plan
    names = (name for name, origin in plan.origins.items() if origin == source.name)
    return plan._replace(own=frozenset(names))


def plan_root(
    root: PackageId, wanted: str, found: Found, store: Store, pinned: Lock | None = None
) -> InstallPlan:
    """Return the install plan for one package, with all archives.

    Args:
        root: the package.
        wanted: range of versions of the package.
        found: available packages, as returned by `merged`.
        store: store whose archives need no download.
        pinned: lock that the result must equal; None accepts any result.

    Raises:
        PackageError: see `plan_requirement`.
    """
    chosen = settle(root, wanted, found)
    lock = lock_of(root, chosen)
    if pinned is not None and lock != pinned:
        raise PackageError(
            f"{root}: the lock does not match the package's dependencies; create a new lock"
        )
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
    return InstallPlan(lock, archives, origins, signatures, remarks=remarks)


def settle(root: PackageId, wanted: str, found: Found) -> dict[PackageId, IndexEntry]:
    """Return the resolved versions without downloads; raise `PackageError` on failure."""
    return resolve(root, wanted, {key: [entry for entry, _ in some] for key, some in found.items()})


def check_names(chosen: Iterable[PackageId]) -> None:
    """Raise `PackageError` for a widget with the name of a built-in widget."""
    for key in chosen:
        if key.kind == "widget" and (shipped("widgets") / key.name / "widget.yaml").is_file():
            raise PackageError(
                f"{key}: packages must not replace URC's built-in widget {key.name!r}"
            )


def origin_lines(plan: InstallPlan, store: Store) -> list[str]:
    """Return one line for each package, stating its origin and signer."""
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


def withdrawn_lines(lock: Lock, entries: Sequence[IndexEntry]) -> list[str]:
    """Return one line for each withdrawn package in a lock, stating the reason."""
    return [
        phrase("{package} was withdrawn: {why}", package=entry, why=entry.why_withdrawn)
        for name, pin in lock.packages.items()
        for entry in entries
        if entry.why_withdrawn and entry.sha256 == pin.sha256 and str(entry.key) == name
    ]


def without_blocked(found: Found, store: Store) -> Found:
    """Return the packages, omitting blocked versions; raise `PackageError` for a damaged store."""
    if not store.blocks.all():
        return found
    kept = {
        key: [one for one in some if not _blocked(one[0], store)] for key, some in found.items()
    }
    return {key: some for key, some in kept.items() if some}


def _blocked(entry: IndexEntry, store: Store) -> list[str]:
    """Return one line for each reason why a version is blocked."""
    return store.blocks.lines(lock_of(entry.key, {entry.key: entry}), lambda _: entry.signed)


def _remark(entry: IndexEntry) -> str:
    """Return the repository's remarks on a version: withdrawal and declared origin, or ""."""
    said: list[str] = []
    if entry.why_withdrawn:
        said.append(phrase("WITHDRAWN: {why}", why=entry.why_withdrawn))
    return joined("; ", said + ([str(entry.provenance)] if entry.provenance else []))


def _left_out(required: PackageRequirement, found: Found, store: Store) -> str:
    """Return the withdrawn and blocked versions that match the requirement, with the reasons."""
    wanted = parse_range(required.range)
    meant = [
        entry
        for key, some in found.items()
        for entry, _ in some
        if key.name == required.name
        and required.kind in ("", key.kind)
        and wanted.allows(entry.number)
    ]
    blocked = [line for entry in meant for line in _blocked(entry, store)]
    if blocked:
        return "; ".join(blocked[-3:])
    gone = [f"{one} was withdrawn: {one.why_withdrawn}" for one in meant if one.why_withdrawn]
    return "; ".join([*gone[-3:], "--withdrawn installs it anyway"]) if gone else ""


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
            raise PackageError(f"{text} {pin.version} is not available with the digest in the lock")
    return kept
