"""`urc list`: list installed packages and available updates."""

import argparse

EXAMPLE = "urc list --json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: selection and output format."""
    parser.add_argument(
        "--updates", action="store_true", help="list only packages with a newer version"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON line per package")


def run(arguments: argparse.Namespace) -> int:
    """Print the packages that the user has installed, with their dependencies."""
    from urc.cli.output import json_text
    from urc.cli.packages import known_entries, open_store
    from urc.packages.install import withdrawn_lines
    from urc.problems import printable

    if arguments.updates:
        return _updates(is_json=arguments.json)
    store = open_store()
    installed = store.installed()
    gone = [one for one in known_entries() if one.why_withdrawn] if installed else []
    for lock in installed:
        withdrawn, blocked = withdrawn_lines(lock, gone), store.blocked(lock)
        needs = {key: pin.version for key, pin in lock.packages.items() if key != lock.root}
        if arguments.json:
            said = {"package": lock.root, "version": lock.version, "needs": needs}
            found = {"withdrawn": withdrawn, "blocked": blocked}
            print(json_text(said | {name: lines for name, lines in found.items() if lines}))
        else:
            rest = ", ".join(f"{key} {version}" for key, version in needs.items())
            print(f"{lock}  with {rest}" if rest else str(lock))
            for line in (*blocked, *withdrawn):
                print(printable(f"  ▲ {line}"))
    return 0


def _updates(*, is_json: bool) -> int:
    """Print the available updates; return 0 even without updates."""
    from urc.cli.output import complain, json_text
    from urc.cli.packages import known_repositories, open_store
    from urc.packages.update import headline, newer
    from urc.problems import printable

    known = known_repositories()
    for update in newer(open_store(), known, complain):
        old, new = update.old, update.new
        if is_json:
            said = {"package": old.root, "version": old.version, "newer": new.version}
            print(json_text({**said, "changes": update.lines}))
        else:
            rest = ", ".join(line for line in update.lines if not line.startswith(f"{old} → "))
            print(printable(f"{headline(old, new)}{f'  with {rest}' if rest else ''}"))
    return 0
