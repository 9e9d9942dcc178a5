"""The options of the camera transport, for cameras that send H.264 or H.265."""

import re
from collections.abc import Mapping
from typing import Final, NamedTuple
from urllib.parse import urlsplit

from urc.model.values import NOTHING
from urc.transports._tls import Tls
from urc.transports.base import TransportError, TransportSetup
from urc.transports.web_origin import Credentials, OptionReader, WebOrigin

__all__ = ["CameraOptions", "main_url", "read_low_options", "read_options"]

_RTSP_PORT, _RTSPS_PORT = 554, 322
_SCHEMES = ("rtsp", "rtsps", "http", "https", "udp", "whep", "wheps", "v4l2")
_LOGINS = ("digest", "basic", "bearer")
_DEVICE: Final = re.compile(r"/dev/(video[0-9]{1,3}|v4l/[A-Za-z0-9_.:+/-]{1,200})")
_FORMAT: Final = re.compile(r"[a-z0-9_]{2,32}")
_SIZE: Final = re.compile(r"[1-9][0-9]{1,4}x[1-9][0-9]{1,4}")
_NOWHERE: Final = WebOrigin(is_secure=False, host="", port=0, path="")


class CameraOptions(NamedTuple):
    """The checked options of a camera transport."""

    scheme: str
    """``rtsp``, ``http``, ``udp``, ``whep`` or ``v4l2``; `place` tells whether TLS is used."""
    place: WebOrigin
    """Target of the connection. For ``udp``, the host is the local address, or "" for all."""
    credentials: Credentials | None
    over: str
    """Whether RTP packets travel over ``tcp`` or ``udp``."""
    sender: str
    """For ``udp``, the only host whose datagrams count; "" for any host."""
    tls: Tls | None
    transcode: str = ""
    """Codec to which other codecs are transcoded: ``h264``, ``h264_software``, ``jpeg``, or ""."""
    device: str = ""
    """For ``v4l2``, the path of the device."""
    device_options: Mapping[str, str] = NOTHING
    """For ``v4l2``, options of the library: format, size and rate."""

    @property
    def address(self) -> str:
        """The camera's address in readable form, without credentials."""
        place = self.place
        wanted = "JPEG" if self.transcode == "jpeg" else "H.264"
        more = f", transcoded to {wanted}" if self.transcode else ""
        if self.scheme == "v4l2":
            return f"camera {self.device}{more}"
        if self.scheme == "udp":
            return f"camera udp {place.host or '*'}:{place.port} (listening){more}"
        return f"camera {self.scheme}{'s' * place.is_secure}://{place.authority}{place.path}{more}"


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
    transcode = options.choice("transcode", ("", "h264", "h264_software", "jpeg"), "")
    if scheme == "v4l2":
        return _device(options, url)._replace(transcode=transcode)
    if scheme == "udp":
        if options.credentials(("digest", "basic")) is not None:
            raise TransportError("camera: a stream over udp has no sign-in; remove auth")
        return CameraOptions("udp", _listener(url), None, "udp", sender, None, transcode)
    return _remote(options, scheme, url, over)._replace(transcode=transcode)


def _remote(options: OptionReader, scheme: str, url: str, over: str) -> CameraOptions:
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


def _device(options: OptionReader, url: str) -> CameraOptions:
    """Return the options of a camera of this computer."""
    path = url.partition("://")[2]
    if not _DEVICE.fullmatch(path) or ".." in path:
        raise TransportError(
            f"camera: url must be a device such as v4l2:///dev/video0, not {url[:80]!r}"
        )
    found = {"input_format": options.text("format", "mjpeg")}
    if not _FORMAT.fullmatch(found["input_format"]):
        raise TransportError(f"camera: format must be a name, not {found['input_format'][:80]!r}")
    if size := options.text("size"):
        if not _SIZE.fullmatch(size):
            raise TransportError(f"camera: size must be text such as 640x480, not {size[:80]!r}")
        found["video_size"] = size
    if rate := options.number("rate", 0, 0, 1000):
        found["framerate"] = f"{rate:g}"
    return CameraOptions("v4l2", _NOWHERE, None, "", "", None, device=path, device_options=found)


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
