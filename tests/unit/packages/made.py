"""Packages for tests, made in a line."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from urc.packages.archive import PACKAGE, write_archive
from urc.packages.index import IndexEntry
from urc.packages.install import plan_file
from urc.packages.install_plan import InstallPlan
from urc.packages.lock import Lock
from urc.packages.package import Package, open_package, sha256
from urc.packages.signature import Signature
from urc.packages.sources import FileSource
from urc.packages.store import Store
from urc.runtime.settings_store import StoredSettings
from urc.web.fleet.robot_factory import RobotFactory, RobotOptions

__all__ = [
    "DOCUMENTS",
    "accepted",
    "assert_whole",
    "entry",
    "files_of",
    "install",
    "keep_settings",
    "package",
    "write_package",
]

DOCUMENTS = {
    "driver": """\
settings:
  host: { type: host, default: 127.0.0.1 }
  key: { type: string, secret: true }
transports:
  wire:
    type: tcp
    host: "{{ settings.host }}"
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
signals:
  battery: { type: integer, unit: "%", min: 0, max: 100 }
commands:
  beep: { send: "beep" }
messages:
  said: { regex: '^(?P<battery>\\d+)$' }
""",
    "interface": "grid: |\n  battery\n",
    "widget": "title: A widget\nsummary: Shows a number.\ninputs: { level: { type: integer } }\n",
    "robot": "driver: ../../drivers/puppet/driver.yaml\n",
}


def files_of(
    kind: str,
    name: str,
    version: str = "1.0.0",
    needs: Mapping[str, str] | None = None,
    text: str | None = None,
    **more: str,
) -> dict[str, bytes]:
    """Return the files of a package; `more` are files of a widget, by name without its ending."""
    manifest = (
        f"urc: 1\npackage: {kind}\nname: {name}\nversion: {version}\nlicence: MIT\n"
        f"authors: [A. Author]\nsummary: The {kind} {name}.\n"
    )
    if needs:
        manifest += "needs:\n" + "".join(f'  {key}: "{value}"\n' for key, value in needs.items())
    body = DOCUMENTS[kind] if text is None else text
    document = f"urc: 1\nkind: {kind}\nname: {name}\n{body}"
    found = {"package.yaml": manifest, f"{kind}.yaml": document}
    if kind == "widget":
        found["widget.js"] = "export default { mount() { return {}; } };\n"
        found["template.html.j2"] = "<b></b>\n"
    found |= {f"{stem}.txt": content for stem, content in more.items()}
    return {path: content.encode() for path, content in found.items()}


def package(
    kind: str,
    name: str,
    version: str = "1.0.0",
    needs: Mapping[str, str] | None = None,
    **more: str,
) -> Package:
    """Return a package, whole and checked."""
    files = files_of(kind, name, version, needs, **more)
    return open_package(write_archive(files, PACKAGE, name), name)


def write_package(
    folder: Path,
    kind: str,
    name: str,
    version: str = "1.0.0",
    needs: Mapping[str, str] | None = None,
    **more: str,
) -> Path:
    """Write a package into a repository's folder; return its own."""
    home = folder / f"{kind}s" / name
    home.mkdir(parents=True, exist_ok=True)
    for path, content in files_of(kind, name, version, needs, **more).items():
        (home / path).write_bytes(content)
    return home


def entry(key: str, version: str, needs: Mapping[str, str] | None = None) -> IndexEntry:
    """Return what an index says, of an archive that nobody looks at."""
    folder, _, name = key.partition("/")
    return IndexEntry(folder[:-1], name, version, "0" * 64, 1, needs=dict(needs or {}))


def install(
    store: Store,
    *packages: Package,
    signatures: Mapping[str, Signature] | None = None,
    is_folder: bool = False,
    waives: bool = True,
) -> Lock:
    """Install the first of some packages, signed or not; the others are its dependencies."""
    root = packages[0].manifest.key
    source = FileSource("test", packages, [root], signatures, is_folder=is_folder)
    plan = plan_file(source, (), store, lambda line: None)
    if waives:
        plan = accepted(plan)
    with store.changing() as change:
        change.stage(plan)
        change.commit(plan)
    return plan.lock


def accepted(plan: InstallPlan) -> InstallPlan:
    """Return the plan with a waiver of every signature."""
    return plan._replace(waived=frozenset(plan.lock.packages))


def keep_settings(data: Path, name: str, settings: Mapping[str, str]) -> None:
    """Have the settings of an installed robot filled in, for where its lines then lead."""

    def unused(*_: object) -> Any:
        raise AssertionError("no robot is made or tried here")

    factory = RobotFactory(RobotOptions(data, unused, unused, lambda _: {}))
    lock = factory.installed_robots()[name][-1]
    kept = StoredSettings(settings=dict(settings), package=lock.root)
    place = factory.resolved_settings(factory.profile(lock), kept).destination
    factory.settings_store(name).save(msgspec.structs.replace(kept, destination=place))


def assert_whole(store: Store) -> list[str]:
    """Look at every byte of a store; return what is installed."""
    for file in (store.folder / "blobs").glob("*"):
        assert sha256(file.read_bytes()) == file.stem, f"{file} is torn"
    for lock in store.installed():
        for pin in lock.packages.values():
            store.blob(pin.sha256)
        assert store.document(lock).is_file()
    return [str(lock) for lock in store.installed()]
