"""`urc replay`: show a recording in the dashboard as if it were live."""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from urc.cli.arguments import add_foxglove, add_host, add_port, duration, load
from urc.cli.data_folder import own_folder
from urc.cli.error_report import Misuse
from urc.cli.output import complain
from urc.cli.start_addresses import access_for, print_entrance, ready_addresses
from urc.cli.tls_options import add_tls, certificates_of, tls_of
from urc.problems import ProblemsError, UrcError

if TYPE_CHECKING:
    from starlette.types import ASGIApp

    from urc.model.profile import Profile
    from urc.runtime.recording.player import Player
    from urc.runtime.recording.reader import Recording

EXAMPLE = "urc replay puppet.mcap --speed 2"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: recording, playback options and address."""
    parser.add_argument("recording", metavar="FILE", type=Path, help="recording to replay")
    parser.add_argument(
        "--profile",
        metavar="PROFILE",
        help="robot file to use for display, for example with a changed interface or third-party"
        " widgets (default: the profile in the recording)",
    )
    parser.add_argument(
        "--speed",
        type=_speed,
        default=1.0,
        metavar="X",
        help="playback speed, 0.1 to 100",
    )
    parser.add_argument(
        "--from",
        dest="start_s",
        type=duration,
        default=0.0,
        metavar="TIME",
        help="start at 90s, 2m …",
    )
    parser.add_argument(
        "--loop", action="store_true", help="when the recording ends, play it again from the start"
    )
    add_host(parser)
    add_port(parser)
    add_foxglove(parser)
    add_tls(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve the recording until Ctrl-C or SIGTERM."""
    from urc.cli.event_loop import run_loop
    from urc.runtime.document_tests import sample_settings
    from urc.runtime.recording.player import Player
    from urc.runtime.recording.reader import open_recording

    recording = open_recording(arguments.recording, has_profile=bool(arguments.profile))
    start_s, length_s = arguments.start_s, recording.length_s
    if start_s > length_s:
        raise Misuse(f"--from {start_s:g}s is after the end of the recording ({length_s:.1f} s)")
    if recording.unread_bytes > 0:
        lost = f"the last {recording.unread_bytes} bytes cannot be read"
        complain(f"urc replay: {recording.file} is damaged or truncated: {lost}")
    elif recording.unread_bytes:
        complain(f"urc replay: {recording.file} is incomplete; the last second may be missing")
    with TemporaryDirectory(prefix="urc-replay-") as folder:
        given = arguments.profile
        profile = load(given) if given else _profile_in(recording, Path(folder))
        player = Player(
            recording,
            profile,
            sample_settings(profile.settings),
            speed=arguments.speed,
            start_s=start_s,
            is_looped=arguments.loop,
        )
        serving = _serve(player, arguments)
        return run_loop(serving, code_when_ended=0)


async def _serve(player: "Player", arguments: argparse.Namespace) -> int:
    from urc.web.app import DashboardOptions, Robot, build_app, serve
    from urc.web.foxglove.port import FoxglovePort

    profile, host, tls = player.profile, arguments.host, tls_of(arguments)
    foxglove = FoxglovePort(arguments.foxglove) if arguments.foxglove is not None else None
    robot = Robot(profile, player.settings, player.session, playback=player)
    access = access_for()
    certificates = await certificates_of(tls, host, (), own_folder())
    app: ASGIApp = build_app(
        {profile.name: robot},
        DashboardOptions(access=access, allowed_hosts=tls.hosts(), certificates=certificates),
    )

    if foxglove is not None:
        app = foxglove.around(app)

    def ready(url: str) -> None:
        print_entrance(ready_addresses(url, host, access, certificates, tls, foxglove))

    await serve(
        tls.around(app),
        host=host,
        port=arguments.port,
        on_ready=ready,
        certificates=certificates,
        further=[foxglove] if foxglove is not None else [],
    )
    return 0


def _profile_in(recording: "Recording", folder: Path) -> "Profile":
    """Unpack the profile stored in a recording into a folder, with the files of its widgets."""
    from urc.runtime.recording.widget_files import unpack_files

    unpack_files(recording.files, folder)
    file = folder / "profile.yaml"
    file.write_text(recording.document, encoding="utf-8")
    try:
        return load(str(file))
    except ProblemsError as error:
        line = str(error).partition("\n")[0].replace(str(file), recording.file.name)
        raise UrcError(f"{line}; select another profile with --profile") from None


def _speed(text: str) -> float:
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0.1 <= speed <= 100:
        raise argparse.ArgumentTypeError(f"expected a speed from 0.1 to 100, found {text!r}")
    return speed
