"""Check for keys of a camera that have no effect with its URL."""

from typing import Final

from urc.config.node import Node, Problems

__all__ = ["check_camera"]

_RTSP: Final = ("rtsp", "rtsps")
_SIGNED_IN: Final = (*_RTSP, "http", "https", "whep", "wheps")
_SCHEMES: Final = {
    "rtp": _RTSP,
    "host": ("udp",),
    "auth": _SIGNED_IN,
    "tls": ("rtsps", "https", "wheps"),
    **dict.fromkeys(("format", "size", "rate"), ("v4l2",)),
    "transcode": (*_RTSP, "http", "https", "udp", "v4l2"),
}
"""Schemes with which each key has an effect."""
_PASSED: Final = ("mjpeg", "h264", "hevc")
"""Formats of devices that pass unchanged."""


def check_camera(part: Node, problems: Problems) -> None:
    """Report a URL besides streams, and each key without effect for a stated scheme."""
    if part.must("type").data != "camera":
        return
    _check_streams(part, problems)
    scheme, mark, _ = part.text("url").lower().partition("://")
    if not mark or "{{" in scheme:
        return
    for key, schemes in _SCHEMES.items():
        if part.data.get(key) and scheme not in schemes:
            _refuse(part, key, scheme, schemes, problems)
    _check_format(part, scheme, problems)
    signed_in = part.get("auth")
    if signed_in is not None and signed_in.text("type") == "bearer" and scheme in _RTSP:
        problems.error(
            signed_in,
            "misplaced-key",
            f"'type: bearer' has no effect with the url {scheme}://",
            at="type",
            hint="RTSP signs in with a user and a password: write type: digest",
        )


def _check_streams(part: Node, problems: Problems) -> None:
    """Report a camera with a stream besides its two streams."""
    if part.get("streams") is not None and part.get("url") is not None:
        problems.error(
            part.must("url"),
            "wrong-form",
            "'url' and 'streams' cannot be used together",
            key=True,
            hint="write the address under streams: high",
        )


def _check_format(part: Node, scheme: str, problems: Problems) -> None:
    wanted = part.get("format")
    if scheme != "v4l2" or wanted is None or part.get("transcode") is not None:
        return
    if "{{" not in wanted.data and wanted.data not in _PASSED:
        problems.error(
            wanted,
            "missing-key",
            f"no browser shows {wanted.data} as it is",
            hint="add transcode: h264, or write format: mjpeg if the camera has it",
        )


def _refuse(
    part: Node, key: str, scheme: str, schemes: tuple[str, ...], problems: Problems
) -> None:
    known = " or ".join(f"{one}://" for one in schemes)
    problems.error(
        part,
        "misplaced-key",
        f"'{key}' has no effect with the url {scheme}://",
        at=key,
        key=True,
        hint=f"remove it: it applies to {known}",
    )
