"""The connection page: which browser features work at this address, and how to trust URC.

Layer 5. The page and the certificate contain no data about robots. Everyone may load both, even
over plain HTTP, because a device needs them before it trusts the certificate.
"""

from dataclasses import dataclass, replace
from typing import Final

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc._translatable import phrase
from urc.web.serve.certificates import Certificates
from urc.web.serve.policy import parse_host
from urc.web.serve.rights import ANYONE, ProtectedRoute
from urc.web.show.pages import PageHead, render
from urc.web.words import spoken, t

__all__ = ["AUTHORITY_PATH", "TRUST_PATH", "DeviceGuide", "TrustPage", "TrustPages"]

TRUST_PATH = "/trust"
AUTHORITY_PATH = "/trust/authority.crt"
_CRT = "application/x-x509-ca-cert"
"""Media type that Android, iOS, macOS, Windows and Firefox accept for certificate authorities."""
_HEADERS = {"cache-control": "no-store"}


@dataclass(frozen=True, slots=True)
class DeviceGuide:
    """A guide for one kind of device, to follow after downloading the certificate."""

    name: str
    """Identifier for scripts, such as ``ios``."""
    title: str
    steps: tuple[str, ...]
    """Steps after the download, in order."""
    removal: str
    """Step for removing the certificate."""
    command: str = ""
    """Command for the last step; "" if the step has no command."""
    removal_command: str = ""


_GUIDES: Final = (
    DeviceGuide(
        "android",
        "Android",
        (
            phrase("Open the settings of the device, and search for “CA certificate”."),
            phrase("Confirm the warning, and choose the downloaded file authority.crt."),
        ),
        phrase("Search for “trusted credentials”, open “User”, and remove the certificate."),
    ),
    DeviceGuide(
        "ios",
        "iPhone, iPad",
        (
            phrase("Download the certificate in Safari, and allow the profile."),
            phrase("Open Settings > General > VPN & Device Management, and install the profile."),
            phrase(
                "Open Settings > General > About > Certificate Trust Settings, and turn on trust"
                " for the certificate."
            ),
        ),
        phrase("Open Settings > General > VPN & Device Management, and remove the profile."),
    ),
    DeviceGuide(
        "windows",
        "Windows (Chrome, Edge)",
        (
            phrase("Open the file, and choose “Install Certificate”, then “Current User”."),
            phrase(
                "Place the certificate in the store “Trusted Root Certification Authorities”, and"
                " confirm."
            ),
            phrase("Close all browser windows, then open the browser again."),
        ),
        phrase(
            "Start certmgr.msc, open “Trusted Root Certification Authorities”, and delete the"
            " certificate."
        ),
    ),
    DeviceGuide(
        "macos",
        "macOS (Safari, Chrome)",
        (
            phrase(
                "Open the file. Keychain Access then adds the certificate to the login keychain."
            ),
            phrase(
                "In Keychain Access, open the certificate and its section “Trust”. Choose “Always"
                " Trust” for SSL."
            ),
        ),
        phrase("Delete the certificate in Keychain Access."),
    ),
    DeviceGuide(
        "linux",
        "Linux (Chrome, Chromium)",
        (
            phrase("Install the program certutil (package libnss3-tools or nss-tools)."),
            phrase("Run this command in the folder of the download, then restart the browser:"),
        ),
        phrase("Run this command:"),
        "mkdir -p $HOME/.pki/nssdb && certutil -d sql:$HOME/.pki/nssdb -A -t C,, -n urc"
        " -i authority.crt",
        "certutil -d sql:$HOME/.pki/nssdb -D -n urc",
    ),
    DeviceGuide(
        "firefox",
        "Firefox",
        (
            phrase(
                "Open the settings, search for “certificates”, and open View Certificates >"
                " Authorities."
            ),
            phrase("Import the file, and select “Trust this CA to identify websites”."),
        ),
        phrase("Choose the certificate in the same list, then “Delete or Distrust”."),
    ),
)
"""Guides in English, to be translated. Each menu has the name that the operating system shows."""


@dataclass(frozen=True, slots=True)
class TrustPage:
    """Context for ``trust.html.j2``."""

    head: PageHead
    fingerprint: tuple[str, ...]
    """Fingerprint of the certificate to trust, in groups of hex digits; empty for plain HTTP."""
    has_authority: bool
    """Whether the server has a local authority for devices to trust."""
    certificate_url: str
    secure_url: str
    """HTTPS URL of this server; "" if the page is loaded over HTTPS, or the server has no HTTPS."""
    guides: tuple[DeviceGuide, ...]


class TrustPages:
    """The routes for the connection page and for the authority's certificate."""

    def __init__(self, certificates: Certificates | None) -> None:
        """Create the routes. Without `certificates`, the server uses plain HTTP."""
        self._certificates = certificates

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes."""
        return [
            ProtectedRoute(TRUST_PATH, self._page, ANYONE),
            ProtectedRoute(AUTHORITY_PATH, self._certificate, ANYONE),
        ]

    async def _page(self, request: Request) -> Response:
        found = self._certificates.current if self._certificates is not None else None
        has_authority = found is not None and bool(found.authority)
        page = TrustPage(
            head=PageHead(request.state.nonce, t("This connection")),
            fingerprint=tuple(found.fingerprint.split()) if found is not None else (),
            has_authority=has_authority,
            certificate_url=AUTHORITY_PATH,
            secure_url=_secure_url(request) if found is not None else "",
            guides=tuple(map(_translated, _GUIDES)) if has_authority else (),
        )
        return HTMLResponse(render("trust.html.j2", page), headers=_HEADERS)

    async def _certificate(self, request: Request) -> Response:
        found = self._certificates.current if self._certificates is not None else None
        if found is None or not found.authority:
            raise HTTPException(404)
        return Response(found.authority, media_type=_CRT, headers=_HEADERS)


def _secure_url(request: Request) -> str:
    host = parse_host(request.headers.get("host", ""))
    if request.url.scheme == "https" or host is None:
        return ""
    return f"https://{host.host}/" if host.port is None else f"https://{host.host}:{host.port}/"


def _translated(guide: DeviceGuide) -> DeviceGuide:
    """Return a guide in the request's language."""
    steps = tuple(map(spoken, guide.steps))
    return replace(guide, steps=steps, removal=spoken(guide.removal))
