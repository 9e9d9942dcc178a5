"""The programs of the test rig: robots, operators, a network, and a real server.

Each program is a separate process. All programs timestamp events with the machine's monotonic
clock, so the times are comparable. A program ends when its standard input closes, so no program
outlives the test that started it.

Linux only. `Relay` needs root and /dev/net/tun; see `can_relay`.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, NamedTuple, Self, cast

__all__ = [
    "SERVER_ADDRESS",
    "Heard",
    "Operators",
    "Program",
    "Relay",
    "Robots",
    "Server",
    "can_relay",
    "peer",
]

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SERVER_ADDRESS = "10.77.0.2"
"""IP address of side ``b`` of the relay; see `bench.rig.relay_process`."""
READY_S = 40.0
ANSWER_S = 10.0
END_S = 5.0
PATIENCE_S = 25.0
"""Maximum time for a page to take control and drive, in seconds; the page's own timeout is shorter.
"""


class Program:
    """A process that receives orders and reports events, both as lines of text."""

    def __init__(self, arguments: Sequence[str], *, inside: Sequence[str] = ()) -> None:
        """Start the program.

        Args:
            arguments: command line.
            inside: command prefix for a network namespace, from `Relay.inside`.
        """
        self.lines: list[str] = []
        """All lines that the program has printed so far, including lines on standard error."""
        self.changed = threading.Condition()
        self._has_ended = False
        self._ordering = threading.Lock()
        self._process = subprocess.Popen(
            [*inside, *arguments],
            cwd=ROOT,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        self._orders = cast("IO[str]", self._process.stdin)
        self._told = cast("IO[str]", self._process.stdout)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        """Return self; the program ends when the `with` block ends."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the program."""
        self.close()

    @property
    def pid(self) -> int:
        """The running program's process id."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Whether the program is still running."""
        return self._process.poll() is None

    def order(self, text: str) -> None:
        """Write one line to the program; any thread may call this method."""
        with self._ordering:
            self._orders.write(text + "\n")
            self._orders.flush()

    def wait_until(self, is_so: Callable[[], bool], timeout_s: float, what: str) -> None:
        """Wait until `is_so` returns True for the output; fail at the time limit."""
        with self.changed:
            self.changed.wait_for(lambda: is_so() or self._has_ended, timeout_s)
            if not is_so():
                said = "\n".join(self.lines[-20:]) or "(nothing)"
                raise AssertionError(f"{what}: not within {timeout_s:g} s; output:\n{said}")

    def wait_for(self, word: str, timeout_s: float = ANSWER_S, *, after: int = 0) -> list[str]:
        """Return the words of the first output line from index `after` that begins with `word`."""

        def found() -> list[str]:
            lines = (line.split() for line in self.lines[after:])
            return next((words for words in lines if words[:1] == [word]), [])

        self.wait_until(lambda: bool(found()), timeout_s, f"a line with {word!r}")
        return found()

    def signal(self, number: int) -> None:
        """Send a signal to the program."""
        self._process.send_signal(number)

    def close(self) -> None:
        """End the program, by force if necessary; further calls do nothing."""
        with contextlib.suppress(BrokenPipeError):  # it has already ended
            self._orders.close()
        self._end()
        self._reader.join(END_S)
        self._told.close()

    def _end(self) -> None:
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _read(self) -> None:
        for line in self._told:
            with self.changed:
                self.lines.append(line.rstrip("\n"))
                self.take(self.lines[-1])
                self.changed.notify_all()
        with self.changed:
            self._has_ended = True
            self.changed.notify_all()

    def take(self, line: str) -> None:
        """Handle an output line in the reader's thread; subclasses override this method."""


@contextlib.contextmanager
def peer(script: str, *arguments: object) -> Iterator[int]:
    """Run the script from ``bench/peers``; yield the port that it prints."""
    command = [sys.executable, "-P", str(HERE.parent / "peers" / script), *map(str, arguments)]
    with Program(command) as program:
        yield int(program.wait_for("ready", 30.0)[1])


def _script(name: str, *arguments: str) -> list[str]:
    # -P: otherwise, its own folder is first on the path, with names from the standard library.
    # -S: only the servers of others need installed packages.
    flags = "-PE" if name in ("foxglove_process.py", "zenoh_process.py") else "-PSE"
    return [sys.executable, flags, str(HERE / name), *arguments]


class Heard(NamedTuple):
    """A line received by a robot."""

    time_ns: int
    """Time of the line's first byte."""
    text: str


class Robots(Program):
    """Robots in one process; see `bench.rig.robot_process`, `foxglove_process`, `zenoh_process`."""

    def __init__(self, places: Sequence[str], *, inside: Sequence[str] = ()) -> None:
        self.heard: list[list[Heard]] = [[] for _ in places]
        """Received lines of each robot."""
        self.late: list[tuple[int, float]] = []
        """Times at which the robots' process woke up late, with delays in milliseconds."""
        self.waits: dict[tuple[int, int], list[tuple[int, float]]] = {}
        """Waits for a processor: end times, and durations in ms.

        The key has two process ids: the process that waited, and the watched process, which is the
        same or its parent.
        """
        self.visits: list[list[tuple[int, bool]]] = [[] for _ in places]
        """Times at which each robot was connected (True) and disconnected (False)."""
        door = places[0].partition(":")[0] if places else ""
        name = f"{door}_process.py" if door in ("foxglove", "zenoh") else "robot_process.py"
        super().__init__(_script(name, *places), inside=inside)
        self.ports = [int(port) for port in self.wait_for("ready")[1:]]

    def take(self, line: str) -> None:
        """Store a report by kind."""
        words = line.split(" ", 3)
        if words[0] == "line":
            self.heard[int(words[1])].append(Heard(int(words[2]), words[3]))
        elif words[0] == "waited":
            of, microseconds = words[3].split()
            waits = self.waits.setdefault((int(words[2]), int(of)), [])
            waits.append((int(words[1]), int(microseconds) / 1000))
        elif words[0] == "late":
            self.late.append((int(words[1]), int(words[2]) / 1000))
        elif words[0] in ("open", "gone"):
            self.visits[int(words[1])].append((int(words[2]), words[0] == "open"))

    def since(self, robot: int, time_ns: int) -> list[Heard]:
        """Return the lines that a robot has received since `time_ns`."""
        with self.changed:
            return [one for one in self.heard[robot] if one.time_ns >= time_ns]

    def latest_ms(self, from_ns: int, until_ns: int) -> float:
        """Return the largest delay in the robots' process between two times, in milliseconds.

        A delay counts if any part of it lies between the two times.
        """
        with self.changed:
            found = [late for at, late in self.late if _overlaps(at, late, from_ns, until_ns)]
        return max(found, default=0.0)

    def waited_ms(self, from_ns: int, until_ns: int, path: Collection[int] | None = None) -> float:
        """Return how long a tick may have waited for watched processes, in milliseconds.

        A tick passes through several watched processes, and through one child of each.
        The result is therefore the sum of the processes' waits that overlap the span.

        Args:
            from_ns: start of the span.
            until_ns: end of the span.
            path: ids of the watched processes on the path; None for all.
        """
        own: dict[int, float] = {}
        of_child: dict[int, float] = {}
        with self.changed:
            for (process, of), waits in self.waits.items():
                if path is not None and of not in path:
                    continue
                ms = sum(ms for at, ms in waits if _overlaps(at, ms, from_ns, until_ns))
                found = own if process == of else of_child
                found[of] = max(ms, found.get(of, 0.0))
        return sum(own.values()) + sum(of_child.values())


def _overlaps(end_ns: int, ms: float, from_ns: int, until_ns: int) -> bool:
    return end_ns >= from_ns and end_ns - ms * 1e6 <= until_ns


class Operators(Program):
    """Pages that vanish in different ways; see `bench.rig.operator_process`."""

    def __init__(self, *, inside: Sequence[str] = ()) -> None:
        self.news: dict[tuple[str, int], str] = {}
        """Rest of each report, keyed by the report's first word and the plan's number."""
        super().__init__(_script("operator_process.py"), inside=inside)

    def take(self, line: str) -> None:
        """Store a report by kind."""
        word, _, rest = line.partition(" ")
        number, _, rest = rest.partition(" ")
        if number.isdigit():
            self.news[word, int(number)] = rest

    def start(self, plan: Mapping[str, object]) -> None:
        """Start a page; `plan` contains fields of `operator_process.Plan`."""
        self.order(json.dumps(plan))

    def await_told(self, word: str, number: int, timeout_s: float = PATIENCE_S) -> str:
        """Return the report `word` of a plan; fail if the plan has failed."""

        def is_told() -> bool:
            return (word, number) in self.news or ("failed", number) in self.news

        self.wait_until(is_told, timeout_s, f"{word!r} of plan {number}")
        if (word, number) not in self.news:
            raise AssertionError(f"plan {number}: {self.news['failed', number]}")
        return self.news[word, number]

    def kill(self, number: int) -> None:
        """End a plan's page, and wait until its process has ended."""
        self.order(json.dumps({"kill": number}))
        self.wait_until(lambda: ("ended", number) in self.news, ANSWER_S, f"end of {number}")


def can_relay() -> bool:
    """Return whether this system can run `Relay`, which needs Linux, root and a TUN device."""
    is_root = sys.platform == "linux" and os.geteuid() == 0
    return is_root and os.access("/dev/net/tun", os.R_OK | os.W_OK)


class Relay(Program):
    """A link between network namespaces; see `bench.rig.relay_process`."""

    def __init__(self, sides: str = "ab") -> None:
        """Make a namespace for each side; `sides` are their names, one letter each."""
        self._done = 0
        self._doing = threading.Lock()
        super().__init__(_script("relay_process.py", sides))
        _, *found = self.wait_for("ready")
        self._descriptors = dict(zip(sides, found, strict=True))

    def take(self, line: str) -> None:
        """Count the orders that the relay has executed."""
        self._done += line.startswith("done")

    def inside(self, side: str) -> tuple[str, ...]:
        """Return the command prefix that starts a program on a side."""
        return ("nsenter", f"--net=/proc/{self.pid}/fd/{self._descriptors[side]}", "--")

    def do(self, *orders: str) -> int:
        """Execute orders such as ``cut a``; return the time of the last order, in nanoseconds."""
        with self._doing:
            wanted = self._done + len(orders)
            self.order("\n".join(orders))
            self.wait_until(lambda: self._done >= wanted, ANSWER_S, f"order {orders}")
            return int(next(line for line in reversed(self.lines) if line.startswith("done"))[5:])


class Server(Program):
    """A real ``urc serve``."""

    def __init__(
        self,
        profiles: Sequence[Path],
        data: Path,
        *options: str,
        host: str = "127.0.0.1",
        inside: Sequence[str] = (),
        module: str = "urc.cli.main",
    ) -> None:
        """Start the server, and wait until it listens.

        Args:
            profiles: paths of the robots' documents.
            data: the server's data folder.
            options: additional options for ``urc serve``.
            host: address to listen on.
            inside: command prefix for a network namespace, from `Relay.inside`.
            module: program that runs ``urc``, such as `bench.rig.server_process`.
        """
        command = [sys.executable, "-m", module, "serve", *map(str, profiles)]
        command += ["--host", host, "--port", "0", "--data-dir", str(data), *options]
        if host != "127.0.0.1":
            command.append("--insecure-plain-http")  # the operators use plain sockets
        self.host = host
        super().__init__(command, inside=inside)
        url = self.wait_for("dashboard", READY_S)[1]
        address, _, self.key = url.partition("?key=")
        self.port = int(address.rstrip("/").rpartition(":")[2])

    @property
    def guards(self) -> list[int]:
        """Process ids of all of the server's guards."""
        found = Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text("ascii").split()
        return [int(child) for child in found if _is_guard(child)]

    def _end(self) -> None:
        if self.is_running:
            self._process.send_signal(signal.SIGCONT)
            self._process.terminate()  # it does not end with its standard input
        super()._end()


def _is_guard(process: str) -> bool:
    try:
        words = Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return False
    return b"urc.guard" in words


def now_ns() -> int:
    """Return the monotonic clock's time, in nanoseconds."""
    return time.monotonic_ns()
