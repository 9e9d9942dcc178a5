"""Films for the benchmarks of videos, encoded once and sent again and again by ffmpeg."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Final

__all__ = ["RATE_HZ", "film", "profile", "sending"]

RATE_HZ: Final = 30
_SECONDS: Final = 10
_PROFILE: Final = """\
urc: 1
kind: robot
name: {name}
title: Film
transports:
{wire}{transports}
signals:
{signals}
messages:
{messages}
{more}"""


def film(folder: Path, kbit: int, size: str = "640x480") -> Path:
    """Encode a film with a noisy test card and a keyframe each second; return its file."""
    target = folder / f"film-{kbit}.ts"
    source = f"testsrc2=size={size}:rate={RATE_HZ},noise=alls=12:allf=t"
    command = ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", source, "-t", str(_SECONDS)]
    command += ["-pix_fmt", "yuv420p", "-c:v", "libx264", "-preset", "veryfast", "-tune"]
    command += ["zerolatency", "-g", str(RATE_HZ), "-b:v", f"{kbit}k", "-maxrate", f"{kbit}k"]
    command += ["-bufsize", f"{kbit}k", "-f", "mpegts", str(target)]
    subprocess.run(command, check=True, timeout=120)
    return target


def sending(file: Path, ports: Sequence[int]) -> list[str]:
    """Return the command that sends a film in real time, the same datagrams to each port."""
    targets = "|".join(f"[f=mpegts]udp://127.0.0.1:{port}?pkt_size=1316" for port in ports)
    command = ["ffmpeg", "-v", "error", "-re", "-stream_loop", "-1", "-i", str(file)]
    return [*command, "-c", "copy", "-map", "0:v", "-f", "tee", targets]


def profile(name: str, cameras: Sequence[int], wire: str = "", more: str = "") -> str:
    """Return a robot with a camera at each port; `wire` is a further transport, `more` commands."""
    numbered = list(enumerate(cameras))
    lines = (
        f'  eye{place}: {{ type: camera, url: "udp://127.0.0.1:{port}" }}\n'
        for place, port in numbered
    )
    return _PROFILE.format(
        name=name,
        wire=wire,
        transports="".join(lines).rstrip("\n"),
        signals="\n".join(
            f"  v{place}: {{ type: video, stale_after: 2s }}" for place, _ in numbered
        ),
        messages="\n".join(
            f"  v{place}: {{ from: eye{place}, raw: v{place} }}" for place, _ in numbered
        ),
        more=more,
    )
