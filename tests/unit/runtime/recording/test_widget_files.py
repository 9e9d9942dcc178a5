"""A recording brings the files of its robot's widgets along."""

from pathlib import Path

import pytest
from mcap.writer import Writer

from urc.config.load import load_profile
from urc.model.profile import Profile
from urc.model.values import Sample
from urc.runtime.recording import widget_files as module
from urc.runtime.recording.reader import open_recording
from urc.runtime.recording.recorder import Recorder
from urc.runtime.recording.widget_files import unpack_files
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped

MODEL = "models/create-2.urdf"


@pytest.fixture
def robot() -> Profile:
    return load_profile(shipped("robots") / "create-2.yaml", built_in_catalog())


def recorded(robot: Profile, file: Path) -> Path:
    recorder = Recorder(file, robot)
    recorder.record([Sample("voltage", 14.0, 1000.0)])
    recorder.close()
    assert recorder.fault == ""
    return file


def test_it_plays_in_another_folder(robot: Profile, tmp_path: Path) -> None:
    """The document names its model, and the model is beside it."""
    found = open_recording(recorded(robot, tmp_path / "a.mcap"))
    assert found.files == {MODEL: (shipped("robots") / MODEL).read_bytes()}
    unpack_files(found.files, tmp_path / "other")
    copy = tmp_path / "other" / "profile.yaml"
    copy.write_text(found.document, "utf-8")
    profile = load_profile(copy, built_in_catalog())
    places = {place for use in profile.uses() for place in use.files.values()}
    assert places == {str(tmp_path / "other" / MODEL)}


def test_it_says_which_file_it_lacks(
    robot: Profile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that is too large is left out; all else is recorded."""
    monkeypatch.setattr(module, "MOST_FILE_BYTES", 10)
    found = open_recording(recorded(robot, tmp_path / "a.mcap"))
    assert found.files == {}
    said = [one.data for one in found.messages(0) if one.topic == "/log"]
    assert any(b"the recording lacks models/create-2.urdf" in text for text in said)


def test_a_forged_recording_writes_nowhere_else(tmp_path: Path) -> None:
    """Neither above its folder, nor over the document, nor a file over a folder."""
    folder = tmp_path / "folder"
    wild = ["../up.urdf", "/root.urdf", "profile.yaml", "a\\b.urdf", "x.md", "x.md/y.md"]
    unpack_files(dict.fromkeys(wild, b"x"), folder)
    assert [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")] == [
        "folder/x.md"
    ]


def test_a_forged_recording_fills_no_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files beyond the limit are not kept."""
    monkeypatch.setattr("urc.runtime.recording.reader.MOST_FILE_BYTES", 100)
    file = tmp_path / "forged.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_attachment(1, 1, "profile.yaml", "application/yaml", b"urc: 1")
        for number in range(5):
            writer.add_attachment(1, 1, f"files/{number}.md", "text/plain", b"x" * 40)
        schema = writer.register_schema("x", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/x", "json", schema), 1, b"{}", 1)
        writer.finish()
    assert sorted(open_recording(file).files) == ["0.md", "1.md"]
