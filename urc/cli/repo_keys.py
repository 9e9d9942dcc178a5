"""`urc repo token` and `urc repo key`: who may publish, and who made what."""

import argparse
from pathlib import Path

from urc.cli.failures import Misuse

__all__ = ["key", "token"]


def token(arguments: argparse.Namespace) -> int:
    """Add, list or remove tokens of a repository."""
    from urc.packages.tokens import Tokens
    from urc.problems import printable

    if arguments.tokens is None:
        raise Misuse(
            "'urc repo token' needs --tokens FILE, the file that 'urc repo serve' is given"
        )
    tokens = Tokens(arguments.tokens)
    match arguments.words:
        case ["add", name]:
            if not arguments.may:
                raise Misuse("'urc repo token add' needs --may: what the token may publish")
            print(tokens.add(name, tuple(arguments.may)))
        case ["remove", name]:
            tokens.remove(name)
            print(f"removed {name}: it may publish nothing any more")
        case ["list"]:
            for one in tokens.all():
                print(printable(f"{one.name}  {', '.join(one.may)}"))
        case _:
            raise Misuse("'urc repo token' takes add NAME, remove NAME or list")
    return 0


def key(arguments: argparse.Namespace) -> int:
    """Make or show one's own key, list those of others, or forget one."""
    from urc._folders import data_folder
    from urc.cli.packages import open_store
    from urc.packages.names import parse_key
    from urc.packages.signature import PUBLISHER, fingerprint, new_signer, read_signer

    file: Path = arguments.key or data_folder() / PUBLISHER
    match arguments.words:
        case ["new", name]:
            made = new_signer(name, file)
            print(f"{made}, in {file}: keep a copy where nobody else can read it")
        case ["show"]:
            own = read_signer(file)
            if own is None:
                raise Misuse(f"{file}: there is no key; 'urc repo key new NAME' makes one")
            print(own)
        case ["list"]:
            for name, kept in sorted(open_store().state().keys.items()):
                print(f"{name}  {fingerprint(kept)}")
        case ["forget", name]:
            with open_store().changing() as change:
                change.forget_key(parse_key(name))
            print(f"forgot the key of {name}; the next one that signs it is kept")
        case _:
            raise Misuse("'urc repo key' takes new NAME, show, list or forget PACKAGE")
    return 0
