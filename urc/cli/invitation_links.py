"""Links with a one-time code, as text and as a QR code in the terminal.

The code is in the link's fragment, which browsers never send to a server. Server logs therefore do
not contain the code.
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
"""Width of a QR code's empty border (quiet zone), in modules (ISO/IEC 18004, 6.3.8)."""
_DARK, _LIGHT = "16", "231"
"""Black and white of the 256-colour palette, which terminal themes do not change."""


def server_address(data: Path, address: str | None) -> str:
    """Return the address at which other devices reach the server, without a trailing slash.

    Args:
        data: data folder that contains the addresses of running servers.
        address: value of `--address`; None selects the newest running server. Without a running
            server, the result is "".

    Raises:
        Misuse: `address` is not a valid server address.
    """
    return _parsed(address) if address else _running(data)


def print_link(data: Path, address: str, page: str, code: str) -> None:
    """Print the link with a code; on a terminal, also print a QR code.

    Args:
        data: data folder, possibly with a local certificate authority.
        address: result of `server_address`; "" prints only the code.
        page: target page of the link: ``pair`` or ``join``.
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

    Each line of text shows two rows of the QR code's modules. If the terminal is too narrow or
    cannot show half blocks, the function yields nothing.
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
    """Return the newest server's address, preferably its public address; "" if none is running."""
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
    """Return the local certificate authority's fingerprint; "" if there is no authority."""
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
