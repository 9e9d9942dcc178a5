"""Messages in FlatBuffers, built by Foxglove's generated classes and Google's library."""

from base64 import b64encode
from importlib.resources import files
from typing import Any

import flatbuffers
import foxglove_schemas_flatbuffer as foxglove
from foxglove_schemas_flatbuffer import (
    CompressedImage,
    LaserScan,
    Log,
    PackedElementField,
    PointCloud,
    Pose,
    PoseInFrame,
    Quaternion,
    Time,
    Vector3,
)

__all__ = ["binary_schema", "image", "log", "point_cloud", "pose_in_frame", "scan", "text_of"]


def binary_schema(name: str) -> bytes:
    """Return the binary schema of one of Foxglove's types, which flatc has compiled."""
    return files(foxglove).joinpath(f"{name}.bfbs").read_bytes()


def text_of(schema: bytes) -> str:
    """Return a schema as a server sends it."""
    return b64encode(schema).decode()


def _pose(builder: Any, place: tuple[float, ...], turn: tuple[float, ...]) -> Any:
    Vector3.Start(builder)
    for add, value in zip((Vector3.AddX, Vector3.AddY, Vector3.AddZ), place, strict=True):
        add(builder, value)
    position = Vector3.End(builder)
    Quaternion.Start(builder)
    adds = (Quaternion.AddX, Quaternion.AddY, Quaternion.AddZ, Quaternion.AddW)
    for add, value in zip(adds, turn, strict=True):
        add(builder, value)
    orientation = Quaternion.End(builder)
    Pose.Start(builder)
    Pose.AddPosition(builder, position)
    Pose.AddOrientation(builder, orientation)
    return Pose.End(builder)


def _finished(builder: Any, root: Any) -> bytes:
    builder.Finish(root)
    return bytes(builder.Output())


def pose_in_frame(
    place: tuple[float, ...], turn: tuple[float, ...], frame: str, sec: int, nsec: int
) -> bytes:
    """Return a foxglove.PoseInFrame."""
    builder = flatbuffers.Builder()
    name, pose = builder.CreateString(frame), _pose(builder, place, turn)
    PoseInFrame.Start(builder)
    PoseInFrame.AddTimestamp(builder, Time.CreateTime(builder, sec, nsec))
    PoseInFrame.AddFrameId(builder, name)
    PoseInFrame.AddPose(builder, pose)
    return _finished(builder, PoseInFrame.End(builder))


def _doubles(builder: Any, start: Any, values: list[float]) -> Any:
    start(builder, len(values))
    for value in reversed(values):
        builder.PrependFloat64(value)
    return builder.EndVector()


def scan(first: float, last: float, ranges: list[float]) -> bytes:
    """Return a foxglove.LaserScan."""
    builder = flatbuffers.Builder()
    found = _doubles(builder, LaserScan.StartRangesVector, ranges)
    LaserScan.Start(builder)
    LaserScan.AddStartAngle(builder, first)
    LaserScan.AddEndAngle(builder, last)
    LaserScan.AddRanges(builder, found)
    return _finished(builder, LaserScan.End(builder))


def image(data: bytes, form: str) -> bytes:
    """Return a foxglove.CompressedImage."""
    builder = flatbuffers.Builder()
    pixels, name = builder.CreateByteVector(data), builder.CreateString(form)
    CompressedImage.Start(builder)
    CompressedImage.AddData(builder, pixels)
    CompressedImage.AddFormat(builder, name)
    return _finished(builder, CompressedImage.End(builder))


def log(level: int, name: str, message: str) -> bytes:
    """Return a foxglove.Log."""
    builder = flatbuffers.Builder()
    owner, text = builder.CreateString(name), builder.CreateString(message)
    Log.Start(builder)
    Log.AddLevel(builder, level)
    Log.AddName(builder, owner)
    Log.AddMessage(builder, text)
    return _finished(builder, Log.End(builder))


def point_cloud(stride: int, fields: list[tuple[str, int, int]], data: bytes, frame: str) -> bytes:
    """Return a foxglove.PointCloud; each field is its name, offset and type."""
    builder = flatbuffers.Builder()
    made = []
    for name, offset, kind in fields:
        title = builder.CreateString(name)
        PackedElementField.Start(builder)
        PackedElementField.AddName(builder, title)
        PackedElementField.AddOffset(builder, offset)
        PackedElementField.AddType(builder, kind)
        made.append(PackedElementField.End(builder))
    PointCloud.StartFieldsVector(builder, len(made))
    for one in reversed(made):
        builder.PrependUOffsetTRelative(one)
    listed = builder.EndVector()
    points, name = builder.CreateByteVector(data), builder.CreateString(frame)
    PointCloud.Start(builder)
    PointCloud.AddFrameId(builder, name)
    PointCloud.AddPointStride(builder, stride)
    PointCloud.AddFields(builder, listed)
    PointCloud.AddData(builder, points)
    return _finished(builder, PointCloud.End(builder))
