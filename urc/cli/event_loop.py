"""A subcommand's event loop, with signal handling and non-blocking output."""

import asyncio
import logging
import os
import queue
import signal
import threading
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any, NamedTuple, TextIO

from urc._event_loop import run
from urc.problems import printable

__all__ = ["LineWriter", "run_loop"]


def run_loop(
    work: Coroutine[Any, Any, int], *, code_when_ended: int | None = None, is_fast: bool = False
) -> int:
    """Run `work` until it returns, or until SIGINT or SIGTERM cancels it; return the exit code.

    A second signal terminates the process immediately.

    Args:
        work: coroutine that returns the exit code; its cleanup after cancellation must be short.
        code_when_ended: exit code after a signal; by default 128 plus the signal number, as in a
            shell.
        is_fast: whether to use the fastest installed event loop. Loading the fastest loop delays
            the start slightly.
    """
    handler = logging.StreamHandler()
    handler.setFormatter(_OneLine())
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
    return (run if is_fast else asyncio.run)(_until_signal(work, code_when_ended))


async def _until_signal(work: Coroutine[Any, Any, int], code_when_ended: int | None) -> int:
    loop = asyncio.get_running_loop()
    task = asyncio.ensure_future(work)
    caught: list[int] = []

    def end(number: int) -> None:
        if caught:
            os._exit(128 + number)
        caught.append(number)
        task.cancel()

    for number in (signal.SIGINT, signal.SIGTERM):
        # Windows has no such handlers; there, Ctrl-C raises KeyboardInterrupt.
        with suppress(NotImplementedError):
            loop.add_signal_handler(number, end, number)
    try:
        return await task
    except asyncio.CancelledError:
        if not caught:
            raise
        return 128 + caught[0] if code_when_ended is None else code_when_ended


class _OneLine(logging.Formatter):
    """A formatter for readable log lines that contain exception names but no tracebacks."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        text = f"{record.levelname.lower()}: {record.name}: {record.getMessage()}"
        fault = record.exc_info[1] if record.exc_info else None
        return printable(f"{text} ({type(fault).__name__}: {fault})" if fault else text)


class _Job(NamedTuple):
    descriptor: int
    data: bytes
    loop: asyncio.AbstractEventLoop
    done: asyncio.Future[None]


class LineWriter:
    """A writer for standard streams that does not block the event loop if the reader is slow.

    A daemon thread writes directly to the file descriptor. Any other kind of thread, or buffered
    `print` output, could block Python's exit indefinitely.
    """

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[_Job] = queue.SimpleQueue()
        threading.Thread(target=self._work, name="writer", daemon=True).start()

    async def write(self, stream: TextIO, text: str) -> None:
        """Write all of `text` before returning.

        Raises:
            OSError: writing failed. A closed stream raises `BrokenPipeError`.
        """
        loop = asyncio.get_running_loop()
        data = text.encode(stream.encoding, "backslashreplace")
        job = _Job(stream.fileno(), data, loop, loop.create_future())
        self._jobs.put(job)
        await job.done

    def _work(self) -> None:
        while True:
            job = self._jobs.get()
            fault: OSError | None = None
            try:
                _write_all(job.descriptor, job.data)
            except OSError as error:
                fault = error
            with suppress(RuntimeError):  # the loop has already ended
                job.loop.call_soon_threadsafe(_settle, job.done, fault)


def _write_all(descriptor: int, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(descriptor, rest) :]


def _settle(done: asyncio.Future[None], fault: OSError | None) -> None:
    if done.done():
        return
    if fault is None:
        done.set_result(None)
    else:
        done.set_exception(fault)
