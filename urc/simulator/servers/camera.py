"""An emulated camera that sends H.264, with the images of the robot's world.

With an ``rtsp`` URL, the camera is an RTSP server. With a ``udp`` URL, it sends datagrams to the
port on which the driver listens. On free ports, a camera with any other URL sends datagrams too.
A camera with two streams has only the high one.

If the robot has a world, the camera sends video while the world gives its signal an image. A rule
can therefore start and stop the video with a command. Without a world, the camera always sends an
image of one colour, which changes slowly.
"""

import asyncio
from collections.abc import Mapping
from importlib.util import find_spec
from urllib.parse import urlsplit

from urc.problems import UrcError
from urc.simulator.servers.base import Endpoint, ServerContext, host_and_port
from urc.simulator.servers.camera_datagrams import DatagramReceiver
from urc.simulator.servers.camera_images import CameraImages
from urc.simulator.servers.rtsp import RtspServer
from urc.simulator.servers.udp import free_port, reachable
from urc.simulator.servers.video_encoder import VideoEncoder
from urc.transports.camera_options import main_url

__all__ = ["CameraServer", "has_encoder"]


def has_encoder() -> bool:
    """Return whether the package that encodes video is installed (extra `video`)."""
    try:
        return find_spec("av") is not None
    except ModuleNotFoundError:  # hidden, as in browsers
        return False


class CameraServer:
    """One emulated camera."""

    def __init__(self, context: ServerContext) -> None:
        clock = asyncio.get_running_loop().time
        self._context = context
        self._images = CameraImages(context, VideoEncoder(), clock)
        self._rtsp: RtspServer | None = None
        self._receiver: DatagramReceiver | None = None
        self._task: asyncio.Task[None] | None = None

    async def open(self) -> Endpoint:
        """Start the camera; without the package that encodes video, only return its address."""
        context = self._context
        url = str(main_url(context.options))
        if url.partition("://")[0].lower() in ("rtsp", "rtsps"):
            server = RtspServer(context, self._images)
            if not has_encoder():
                return _silent({"url": url, "streams": None})
            found = await server.open()
            found = found._replace(options={**found.options, "streams": None})
            self._rtsp = server
        else:
            port = free_port(context.host) if context.is_anywhere else _port(context, url)
            host = reachable(context.host)
            options: dict[str, object] = {"url": f"udp://{host_and_port(host, port)}", "host": host}
            options |= dict.fromkeys(("auth", "tls", "streams", "format", "size", "rate"))
            if _sends_images(context.options):
                options["transcode"] = "jpeg"
            if not has_encoder():
                return _silent(options)
            text = f"camera, sends to {host_and_port(host, port)}"
            found = Endpoint(host, port, text, options)
            self._receiver = DatagramReceiver(context, port)
            self._images.receivers.add(self._receiver)
        self._task = asyncio.create_task(self._images.run())
        return found

    async def close(self) -> None:
        """End the camera and the process that encodes its images."""
        if self._rtsp is not None:
            await self._rtsp.close()
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        if self._receiver is not None:
            self._receiver.close()


def _sends_images(options: Mapping[str, object]) -> bool:
    """Return whether the driver expects JPEG images of a camera of its computer."""
    is_device = str(options.get("url")).lower().startswith("v4l2://")
    is_video = options.get("transcode") or options.get("format") in ("h264", "hevc")
    return is_device and not is_video


def _silent(options: dict[str, object]) -> Endpoint:
    return Endpoint("", 0, "camera, without video: the package av is missing", options)


def _port(context: ServerContext, url: str) -> int:
    """Return the port of a ``udp`` URL."""
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        parts, port = urlsplit(""), None
    if parts.scheme != "udp" or not port:
        raise UrcError(
            f"transports.{context.name}.url: a camera is emulated at an rtsp:// or udp:// URL with"
            f" a port, not at {url[:80]!r}"
        )
    return port
