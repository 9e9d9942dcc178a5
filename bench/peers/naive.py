"""Pages as one writes them first: ``python naive.py KIND ROBOT_PORT [FOLDER]``; prints its port.

Each line of the robot goes to the pages as it comes. ``many``: every value is a message of its own,
and is written by a page with sixty places as it arrives. ``traces``: a page that draws all points
anew in each frame, by uPlot (from FOLDER), and the scan as a dot for each ray.
"""

import asyncio
import http
import json
import sys
from pathlib import Path

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

LONGEST = 1 << 17
START = b"""<!doctype html><meta charset="utf-8"><title>naive</title>
<style>
body { margin: 0; display: grid; gap: 4px; height: 100vh; font: 20px sans-serif; }
.many { grid-template-columns: repeat(10, 1fr); grid-auto-rows: 1fr; }
.cell { position: relative; overflow: hidden; border: 1px solid; container-type: size; }
.bar { position: absolute; bottom: 0; height: 12px; background: teal; }
svg { width: 60%; }
canvas { max-width: 100%; }
</style>
<body>
"""
MANY = b"""<script>
document.body.className = "many";
for (let number = 0; number < 60; number += 1) {
  const needle = `<path class="needle" d="M0 1L0 -9" stroke="red"/>`;
  const svg = number % 3 ? "" : `<svg viewBox="-10 -10 20 20">${needle}</svg>`;
  document.body.insertAdjacentHTML("beforeend",
    `<div class="cell" id="c${number}"><span></span>${svg}<div class="bar"></div></div>`);
}
new WebSocket(`ws://${location.host}/ws`).onmessage = ({ data }) => {
  const { signal, value } = JSON.parse(data);
  const cell = document.getElementById(`c${Number(signal.slice(1)) % 60}`);
  cell.querySelector("span").textContent = value.toFixed(1);
  cell.querySelector(".bar").style.width = `${value}%`;
  cell.querySelector(".needle")?.setAttribute("transform", `rotate(${value * 2.7 - 135})`);
};
</script>"""
TRACES = b"""<link rel="stylesheet" href="/uPlot.min.css"><script src="/uPlot.iife.min.js"></script>
<canvas id="scan" width="900" height="900"></canvas>
<script>
const POINTS = 3000, SERIES = 10;
const data = Array.from({ length: SERIES + 1 }, () => []);
for (let point = 0; point < POINTS; point += 1) {
  data[0].push(point / 60);
  for (let each = 1; each <= SERIES; each += 1) {
    data[each].push(each - 5 + 5 * Math.sin(point / 50 + each));
  }
}
const series = data.map((_, each) => (each ? { stroke: `hsl(${each * 36} 70% 40%)` } : {}));
const [width, height] = [innerWidth / 2 - 10, innerHeight - 60];
const options = { width, height, series, scales: { x: { time: false } }, legend: { show: false } };
const plot = new uPlot(options, data, document.body);
document.body.style.gridTemplateColumns = "1fr 1fr";
const pen = document.getElementById("scan").getContext("2d");
let hasNews = false, ranges = null, last = POINTS / 60;
new WebSocket(`ws://${location.host}/ws`).onmessage = ({ data: line }) => {
  const news = JSON.parse(line);
  if (news.r) ranges = news.r;
  else {
    last += 1 / 60;
    data[0].push(last);
    for (let each = 1; each <= SERIES; each += 1) data[each].push(news[`p${each - 1}`]);
    for (const column of data) if (column.length > POINTS) column.shift();
    hasNews = true;
  }
};
const frame = () => {
  if (hasNews) plot.setData(data);
  if (ranges) {
    pen.clearRect(0, 0, 900, 900);
    ranges.forEach((distance, ray) => {
      const angle = ray / ranges.length * 2 * Math.PI;
      pen.beginPath();
      const [x, y] = [distance * Math.cos(angle), distance * Math.sin(angle)];
      pen.arc(450 + x * 45, 450 + y * 45, 2, 0, 7);
      pen.fill();
    });
  }
  hasNews = false;
  ranges = null;
  requestAnimationFrame(frame);
};
requestAnimationFrame(frame);
</script>"""


def page(_: ServerConnection, request: Request) -> Response | None:
    """Answer anything but the WebSocket with the page, or a file of the folder."""
    if request.path == "/ws":
        return None
    body, kind = START + (MANY if sys.argv[1] == "many" else TRACES), "text/html"
    if request.path.startswith("/uPlot."):
        body = (Path(sys.argv[3]) / request.path[1:]).read_bytes()
        kind = "text/css" if request.path.endswith(".css") else "text/javascript"
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(body))})
    return Response(http.HTTPStatus.OK, "OK", headers, body)


async def stay(line: ServerConnection) -> None:
    """Keep the page's line open."""
    await line.wait_closed()


async def main() -> None:
    """Relay for ever."""
    reader, _ = await asyncio.open_connection("127.0.0.1", int(sys.argv[2]), limit=LONGEST)
    async with serve(stay, "127.0.0.1", 0, process_request=page, compression=None) as server:
        print("ready", next(iter(server.sockets)).getsockname()[1], flush=True)
        while line := await reader.readline():
            if not server.connections:
                continue
            if sys.argv[1] == "traces":
                broadcast(server.connections, line.decode().strip())
                continue
            for name, value in json.loads(line).items():
                broadcast(server.connections, json.dumps({"signal": name, "value": value}))


if __name__ == "__main__":
    asyncio.run(main())
