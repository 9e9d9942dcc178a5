"""Links with a code that works once, as text and as a QR code in the terminal.

The code is in the fragment of the link. Browsers never send the fragment to a server, so no log
contains the code.
"""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

from urc.cli.error_report import Misuse
from urc.cli.output import complain

__all__ = ["print_link", "qr_lines", "server_address"]

_BORDER = 4
"""Width of the quiet zone in modules (ISO/IEC 18004, 6.3.8)."""
_DARK, _LIGHT = "16", "231"
"""Black and white of the 256-colour palette, which themes of terminals leave alone."""


def server_address(data: Path, address: str | None) -> str:
    """Return the address of the server for other devices, without a slash at its end.

    Args:
        data: data folder, with the addresses of running servers.
        address: value of `--address`; None means the newest running server, or "" without one.

    Raises:
        Misuse: `address` is not the address of a server.
    """
    return _parsed(address) if address else _running(data)


def print_link(data: Path, address: str, page: str, code: str) -> None:
    """Print the link of a code, and its QR code if standard output is a terminal.

    Args:
        data: data folder, with the local certificate authority, if any.
        address: result of `server_address`; if it is "", the code is printed alone.
        page: page of the link: ``pair`` or ``join``.
        code: the code.
    """
    if not address:
        print(code)
        complain(
            f"no server is running: start 'urc serve', open the page /{page} and enter the code;"
            " --address prints a link instead"
        )
        return
    link = f"{address}/{page}#{code}"
    print(link)
    if sys.stdout.isatty():
        for line in qr_lines(link, os.get_terminal_size().columns):
            print(line)
    if fingerprint := _fingerprint(data):
        complain(f"fingerprint of this server's certificate authority: {fingerprint}")


def qr_lines(text: str, columns: int) -> Iterator[str]:
    """Yield the lines of a QR code, black on white on any background.

    One line has two rows of modules. Yield nothing if the terminal is too narrow, or cannot show
    half blocks.
    """
    import segno

    code = segno.make(text, error="l", micro=False)
    rows = [list(row) for row in code.matrix_iter(border=_BORDER)]
    if len(rows[0]) > columns or not _has_blocks():
        return
    rows += [[0] * len(rows[0])] * (len(rows) % 2)
    for upper, lower in zip(rows[::2], rows[1::2], strict=True):
        cells = (_cell(bool(top), bool(bottom)) for top, bottom in zip(upper, lower, strict=True))
        yield "".join(cells) + "\x1b[0m"


def _cell(is_top_dark: bool, is_bottom_dark: bool) -> str:
    top, bottom = (_DARK if dark else _LIGHT for dark in (is_top_dark, is_bottom_dark))
    return f"\x1b[38;5;{top};48;5;{bottom}m▀"


def _has_blocks() -> bool:
    return (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"


def _parsed(address: str) -> str:
    try:
        parts = urlsplit(address)
        is_web = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        is_web = False
    if not is_web or parts.query or parts.fragment or parts.username:
        raise Misuse(
            f"--address: expected an address like https://robots.lab:8080, found {address!r}"
        )
    return address.rstrip("/")


def _running(data: Path) -> str:
    """Return the address of the newest server, preferably one for other devices; "" without one."""
    from urc.runtime.running_servers import servers

    running = list(servers(data).values())
    reachable = next((one.public for one in running if one.public), "")
    if running and not reachable:
        complain(
            "the running server accepts clients on this machine only;"
            " start 'urc serve' with --host for other devices"
        )
    return (reachable or next((one.address for one in running), "")).rstrip("/")


def _fingerprint(data: Path) -> str:
    """Return the fingerprint of the local certificate authority, or "" without one."""
    from urc.access.authority import AUTHORITY_FOLDER, fingerprint

    file = data / AUTHORITY_FOLDER / "authority.pem"
    try:
        pem = file.read_bytes()
    except OSError:
        return ""
    from cryptography import x509

    try:
        return fingerprint(x509.load_pem_x509_certificate(pem))
    except ValueError as error:
        complain(f"{file}: this certificate is damaged: {error}")
        return ""
