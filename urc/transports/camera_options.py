"""The options of the camera transport, for cameras that send H.264 or H.265."""

from collections.abc import Mapping
from typing import NamedTuple
from urllib.parse import urlsplit

from urc.transports._tls import Tls
from urc.transports.base import TransportError, TransportSetup
from urc.transports.web_origin import Credentials, OptionReader, WebOrigin

__all__ = ["CameraOptions", "main_url", "read_low_options", "read_options"]

_RTSP_PORT, _RTSPS_PORT = 554, 322
_SCHEMES = ("rtsp", "rtsps", "http", "https", "udp", "whep", "wheps")
_LOGINS = ("digest", "basic", "bearer")


class CameraOptions(NamedTuple):
    """The checked options of a camera transport."""

    scheme: str
    """``rtsp``, ``http``, ``udp`` or ``whep``; the member `place` tells whether TLS is used."""
    place: WebOrigin
    """Target of the connection. For ``udp``, the host is the local address, or "" for all."""
    credentials: Credentials | None
    over: str
    """Whether RTP packets travel over ``tcp`` or ``udp``."""
    sender: str
    """For ``udp``, the only host whose datagrams count; "" for any host."""
    tls: Tls | None

    @property
    def address(self) -> str:
        """The camera's address in readable form, without credentials."""
        place = self.place
        if self.scheme == "udp":
            return f"camera udp {place.host or '*'}:{place.port} (listening)"
        return f"camera {self.scheme}{'s' * place.is_secure}://{place.authority}{place.path}"


def main_url(options: Mapping[str, object]) -> object:
    """Return the URL of a camera's only stream, or of its high stream."""
    streams = options.get("streams")
    return streams.get("high") if isinstance(streams, Mapping) else options.get("url")


def read_low_options(setup: TransportSetup) -> CameraOptions | None:
    """Return the options of the low stream; None for a camera without one.

    Raises:
        TransportError: an option is invalid.
    """
    streams = setup.options.get("streams")
    if not isinstance(streams, Mapping):
        return None
    options = {**setup.options, "streams": None, "url": streams.get("low")}
    return read_options(setup._replace(options=options))


def read_options(setup: TransportSetup) -> CameraOptions:
    """Return the options of a camera's only stream, or of its high stream.

    Raises:
        TransportError: an option is invalid.
    """
    options = OptionReader("camera", {**setup.options, "url": main_url(setup.options)})
    url = options.text("url")
    scheme = url.partition("://")[0].lower()
    if scheme not in _SCHEMES:
        known = ", ".join(f"{one}://" for one in _SCHEMES)
        raise TransportError(f"camera: url must begin with one of {known}, not {url[:80]!r}")
    over = options.choice("rtp", ("tcp", "udp"), "tcp")
    sender = options.text("host")
    if scheme != "udp" and sender:
        raise TransportError("camera: host has an effect only with a udp:// url")
    if scheme not in ("rtsp", "rtsps") and over == "udp":
        raise TransportError("camera: rtp has an effect only with an rtsp:// url")
    if setup.tunnel is not None:
        raise TransportError("camera cannot be tunnelled; remove tunnel")
    if scheme == "udp":
        if options.credentials(("digest", "basic")) is not None:
            raise TransportError("camera: a stream over udp has no sign-in; remove auth")
        return CameraOptions("udp", _listener(url), None, "udp", sender, None)
    plain = scheme.removesuffix("s")
    place = options.place(plain)
    if plain == "rtsp" and urlsplit(url).port is None:
        place = place._replace(port=_RTSPS_PORT if place.is_secure else _RTSP_PORT)
    if plain == "http" and place.path.endswith("/whep"):
        raise TransportError(f"camera: for WHEP, url must begin with whep{scheme[4:]}://")
    credentials = options.credentials(_LOGINS)
    if plain == "rtsp" and credentials is not None and credentials.kind == "bearer":
        raise TransportError("camera: auth with a token has no effect with an rtsp:// url")
    return CameraOptions(plain, place, credentials, over, "", options.tls(place))


def _listener(url: str) -> WebOrigin:
    wanted = f"camera: url must be a local address such as udp://0.0.0.0:11111, not {url[:80]!r}"
    try:
        parts = urlsplit(url)
        host, port = parts.hostname or "", parts.port
    except ValueError as fault:
        raise TransportError(wanted) from fault
    if not port or parts.path.strip("/") or parts.query or parts.username is not None:
        raise TransportError(wanted)
    every = ("0.0.0.0", "*")  # noqa: S104 - the words for all addresses in a document
    return WebOrigin(is_secure=False, host="" if host in every else host, port=port, path="")
