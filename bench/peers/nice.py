"""The benchmark's page in NiceGUI: ``python nice.py ROBOT_PORT PORT``."""

import asyncio
import sys

from nicegui import app, ui

robot_port, port = int(sys.argv[1]), int(sys.argv[2])
labels: set[ui.label] = set()
listening: list[asyncio.Task[None]] = []
"""Running tasks; the event loop's weak references do not protect them from garbage collection."""


@ui.page("/")
def index() -> None:
    """Show the value."""
    labels.add(ui.label("-"))


async def listen() -> None:
    """Show each line."""
    reader, _ = await asyncio.open_connection("127.0.0.1", robot_port)
    while line := await reader.readline():
        text = line.decode().strip()
        for label in labels:
            label.set_text(text)


app.on_startup(lambda: listening.append(asyncio.create_task(listen())))
ui.run(host="127.0.0.1", port=port, show=False, reload=False)
