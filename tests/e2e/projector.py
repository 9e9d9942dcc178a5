"""A camera with an encoder of its own: H.264 over UDP, of a scene that a test chooses."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import av

from tests.films import GROUP, HEIGHT, RATE, WIDTH, FilmKind, film_image

__all__ = ["Projector", "projecting"]

_OPTIONS = {"preset": "ultrafast", "tune": "zerolatency"}


class Projector:
    """Encodes 30 images a second, each anew, until it is closed."""

    def __init__(self, port: int, kind: FilmKind = "moving") -> None:
        """Send to a port of loopback."""
        self.kind: FilmKind = kind
        """What the camera sees from the next image on; ``standing`` repeats the last image."""
        self._port = port
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="projector", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the film."""
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        url = f"udp://127.0.0.1:{self._port}?pkt_size=1316"
        with av.open(url, "w", format="mpegts", options={"flush_packets": "1"}) as target:
            stream = target.add_stream("libx264", rate=RATE, options=_OPTIONS)
            assert isinstance(stream, av.VideoStream)
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
            stream.codec_context.gop_size = GROUP
            began_s = time.monotonic()
            image = film_image(0, self.kind)
            for place in count():
                if self.kind != "standing":
                    image = film_image(place, self.kind)
                frame = av.VideoFrame.from_ndarray(image, "rgb24")
                frame.pts = place
                for packet in stream.encode(frame):
                    target.mux(packet)
                if self._is_over.wait(max(0.0, began_s + (place + 1) / RATE - time.monotonic())):
                    return


@contextmanager
def projecting(port: int, kind: FilmKind = "moving") -> Iterator[Projector]:
    """Project a film for the length of the context."""
    projector = Projector(port, kind)
    try:
        yield projector
    finally:
        projector.close()
