"""A camera by GStreamer's RTSP server; each image contains the time at which it was made.

    python3 stamped_camera.py PORT

The path is /cam. For Debian's Python, because `gi` is not in the registry. The images have
640 × 480 pixels, 30 a second. The first row contains the machine's monotonic clock in milliseconds,
modulo 2 ** 20. It has 20 blocks of 32 × 32 pixels, black for 0 and white for 1, lowest bit first.
The last row repeats it, so that the ends of the access units differ. Between them, a bar moves.
"""

import sys
import threading
import time

import gi

for name in ("Gst", "GstRtspServer"):
    gi.require_version(name, "1.0")
from gi.repository import GLib, Gst, GstRtspServer  # noqa: E402 - after its version

WIDTH, HEIGHT, RATE, BLOCK, BITS = 640, 480, 30, 32, 20
BLACK, GREY, WHITE = b"\x10", b"\x80", b"\xeb"
COLOURLESS = GREY * (WIDTH * HEIGHT // 2)


def image(time_ms: int) -> bytes:
    """Return an image in I420 with its time."""
    stamp = b"".join((WHITE if time_ms >> bit & 1 else BLACK) * BLOCK for bit in range(BITS))
    left = time_ms // 4 % (WIDTH - BLOCK)
    row = GREY * left + WHITE * BLOCK + GREY * (WIDTH - BLOCK - left)
    return stamp * BLOCK + row * (HEIGHT - 2 * BLOCK) + stamp * BLOCK + COLOURLESS


def film(source: Gst.Element) -> None:
    """Push images until the pipeline ends."""
    due_s = time.monotonic()
    while True:
        time_ms = time.monotonic_ns() // 1_000_000 % 2**BITS
        if source.emit("push-buffer", Gst.Buffer.new_wrapped(image(time_ms))) != Gst.FlowReturn.OK:
            return
        due_s += 1 / RATE
        time.sleep(max(0.0, due_s - time.monotonic()))


def begin(_: object, media: GstRtspServer.RTSPMedia) -> None:
    """Film for a new pipeline."""
    source = media.get_element().get_by_name("film")
    threading.Thread(target=film, args=(source,), daemon=True).start()


Gst.init(None)
factory = GstRtspServer.RTSPMediaFactory()
factory.set_shared(True)
factory.set_launch(
    "( appsrc name=film is-live=true do-timestamp=true format=time"
    " max-buffers=2 leaky-type=downstream"
    f" caps=video/x-raw,format=I420,width={WIDTH},height={HEIGHT},framerate={RATE}/1"
    f" ! x264enc tune=zerolatency threads=1 speed-preset=ultrafast key-int-max={RATE}"
    " ! rtph264pay name=pay0 pt=96 config-interval=-1 )"
)
factory.connect("media-configure", begin)
server = GstRtspServer.RTSPServer()
server.set_address("127.0.0.1")
server.set_service(sys.argv[1])
server.get_mount_points().add_factory("/cam", factory)
server.attach(None)
print("ready", flush=True)
GLib.MainLoop().run()
