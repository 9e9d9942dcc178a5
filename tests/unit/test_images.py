"""The size of a picture by its first bytes, compared with pictures that another program wrote."""

from io import BytesIO

import pytest
from PIL import Image

from urc.images import MAX_PIXELS, media_type, picture_size, pixels
from urc.model.values import Signal
from urc.protocol.values.convert import BadValue
from urc.protocol.values.decode import build_converter

FORMATS = [
    ("PNG", {}),
    ("JPEG", {}),
    ("JPEG", {"progressive": True, "exif": b"Exif\0\0" + b"\xff\xc0" * 40}),
    ("GIF", {}),
    ("BMP", {}),
    ("WEBP", {"lossless": True}),
    ("WEBP", {"quality": 40}),
    ("WEBP", {"quality": 40, "exif": b"Exif\0\0"}),
]


def picture(form: str, width: int, height: int, **how: object) -> bytes:
    """Return a grey picture, written by Pillow."""
    written = BytesIO()
    Image.new("RGB", (width, height), (90, 90, 90)).save(written, form, **how)
    return written.getvalue()


@pytest.mark.parametrize(("form", "how"), FORMATS)
def test_width_and_height_stand_in_the_first_bytes(form: str, how: dict[str, object]) -> None:
    data = picture(form, 321, 123, **how)
    assert media_type(data) == f"image/{form.lower()}"
    assert picture_size(data) == (321, 123)


@pytest.mark.parametrize(("form", "how"), FORMATS)
def test_a_picture_that_is_cut_short_has_no_size_or_the_right_one(
    form: str, how: dict[str, object]
) -> None:
    data = picture(form, 321, 123, **how)
    for length in range(min(len(data), 700)):
        assert picture_size(data[:length]) in (None, (321, 123))


def test_a_small_file_of_a_huge_picture_is_no_value() -> None:
    """24 kB of PNG are 14,000 by 14,000 pixels, which is 784 MB in a browser."""
    signal = Signal("front", "image")
    huge = picture("PNG", 4, 4)[:16] + (14_000).to_bytes(4, "big") * 2 + b"\x08\x02\0\0\0"
    with pytest.raises(BadValue, match="an image of 14000 by 14000 pixels; the limit is 16000000"):
        build_converter(signal)(huge)
    assert build_converter(Signal("file", "blob"))(huge) == huge, (
        "what is no image is not looked at"
    )


def test_a_picture_of_a_good_camera_passes() -> None:
    data = picture("JPEG", 4608, 3456)
    assert pixels(data) <= MAX_PIXELS
    assert build_converter(Signal("front", "image"))(data) == data
