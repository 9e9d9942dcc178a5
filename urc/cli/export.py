"""`urc export`: write a video of a recording to an MP4 file."""

import argparse
from pathlib import Path

from urc.cli.output import complain
from urc.problems import printable

EXAMPLE = "urc export rover.mcap front -o front.mp4"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: recording, signal and output file."""
    parser.add_argument("recording", metavar="FILE", type=Path, help="recording with the video")
    parser.add_argument("signal", metavar="SIGNAL", help="signal of type video")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=Path,
        help="new MP4 file (default: RECORDING-SIGNAL.mp4 in the current folder)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the file; return 0."""
    from urc.runtime.recording.film import export_film
    from urc.runtime.recording.reader import open_recording

    recording = open_recording(arguments.recording, has_profile=True)
    if recording.unread_bytes > 0:
        lost = f"the last {recording.unread_bytes} bytes cannot be read"
        complain(f"urc export: {recording.file} is damaged or truncated: {lost}")
    name = f"{recording.file.stem}-{Path(arguments.signal).name}.mp4"
    target = arguments.output or Path(name)
    film = export_film(recording, arguments.signal, target)
    if film.ended:
        complain(f"urc export: the film ends early: {film.ended}")
    print(printable(f"{target}: {film.images} images of {film.length_s:.1f} s"))
    return 0
