"""Pictures that tests push, and the pixels that they look for."""

import asyncio
import io
import struct
import zlib

from PIL import Image
from playwright.async_api import Page

__all__ = ["BLUE", "GREEN", "GREY", "PIXELS_OF", "RED", "plain", "png", "until_pixel", "until_seen"]

WAIT_S = 30.0

RED, BLUE, GREEN, GREY = (200, 0, 0), (0, 0, 200), (0, 200, 0), (90, 90, 90)

PIXELS_OF = """
(canvas) => {
  const { width, height } = canvas;
  const pen = new OffscreenCanvas(width, height).getContext("2d");
  pen.drawImage(canvas, 0, 0);
  return { width, height, data: pen.getImageData(0, 0, width, height).data };
}
"""
"""What a canvas shows, however it was drawn; a WebGL one only in the frame in which it was."""

PIXEL = f"""
([selector, x, y]) => {{
  const {{ width, height, data }} = ({PIXELS_OF})(document.querySelector(selector));
  const place = 4 * (Math.floor(y * height) * width + Math.floor(x * width));
  return [...data.slice(place, place + 4)];
}}
"""


def png(rows: list[list[tuple[int, int, int]]] | list[list[int]]) -> bytes:
    """Return a picture: colours, or one grey channel of 16 bits."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    is_grey = isinstance(rows[0][0], int)
    lines = b"".join(
        b"\0" + b"".join(struct.pack(">H", p) if isinstance(p, int) else bytes(p) for p in row)
        for row in rows
    )
    size = struct.pack(">II", len(rows[0]), len(rows))
    head = size + (b"\x10\0\0\0\0" if is_grey else b"\x08\x02\0\0\0")
    parts = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def plain(colour: tuple[int, int, int]) -> bytes:
    """Return a picture of one colour."""
    return png([[colour] * 8] * 6)


async def until_pixel(page: Page, selector: str, x: float, y: float, is_one: str) -> None:
    """Wait until a pixel of a canvas is what an expression over r, g, b and a says."""
    await page.wait_for_function(
        f"(given) => {{ const [r, g, b, a] = ({PIXEL})(given); return {is_one}; }}",
        arg=[selector, x, y],
    )


async def until_seen(
    page: Page, selector: str, x: float, y: float, colour: tuple[int, int, int]
) -> None:
    """Wait until a place of an element has a colour on the screen, scaled and turned as it is."""
    async with asyncio.timeout(WAIT_S):
        while True:
            shot = await page.locator(selector).screenshot()
            image = Image.open(io.BytesIO(shot)).convert("RGB")
            if image.getpixel((int(x * image.width), int(y * image.height))) == colour:
                return
