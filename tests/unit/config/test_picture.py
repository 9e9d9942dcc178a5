"""The picture of a robot: an image with the document's name, next to the document."""

from pathlib import Path

import pytest

from urc.config.link.resources import MOST_PICTURE_BYTES, PICTURE_TYPES, find_picture
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped


def written(place: Path, size: int = 10) -> Path:
    place.parent.mkdir(exist_ok=True)
    place.write_bytes(b"x" * size)
    return place


@pytest.mark.parametrize("suffix", PICTURE_TYPES)
@pytest.mark.parametrize("folder", [".", "pictures"])
def test_a_picture_has_the_name_of_the_document(tmp_path: Path, folder: str, suffix: str) -> None:
    place = written(tmp_path / folder / f"rover{suffix}")
    written(tmp_path / folder / f"other{suffix}")
    assert find_picture(str(tmp_path / "rover.yaml")) == str(place.resolve())


def test_a_picture_next_to_the_document_comes_first(tmp_path: Path) -> None:
    written(tmp_path / "pictures" / "rover.svg")
    place = written(tmp_path / "rover.jpg")
    assert find_picture(str(tmp_path / "rover.yaml")) == str(place.resolve())


def test_a_robot_needs_no_picture(tmp_path: Path) -> None:
    """Nor does a file of another type count, or one that is too large for a card."""
    written(tmp_path / "rover.exe")
    written(tmp_path / "rover.png", MOST_PICTURE_BYTES + 1)
    assert find_picture(str(tmp_path / "rover.yaml")) == ""


def test_a_link_out_of_the_folder_is_no_picture(tmp_path: Path) -> None:
    """A package could otherwise show any file of the server."""
    secret = written(tmp_path / "secret" / "key.png")
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "rover.png").symlink_to(secret)
    assert find_picture(str(tmp_path / "package" / "rover.yaml")) == ""


@pytest.mark.parametrize("name", sorted(one.stem for one in shipped("robots").glob("*.yaml")))
def test_every_shipped_robot_has_a_picture(name: str) -> None:
    profile = load_profile(str(shipped("robots") / f"{name}.yaml"), built_in_catalog())
    assert Path(profile.picture).name == f"{name}.svg"
