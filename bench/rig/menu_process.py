"""A menu of a dashboard that stays open: a separate program without imports from URC.

``python menu_process.py PORT EVERY_S`` asks for the list of robots again and again. The environment
variable URC_BENCH_KEY contains the server's start key. The program prints a line for each list, and
ends when its standard input closes::

    list ROBOTS LOST        numbers of all robots and of lost robots
"""

import http.client
import json
import os
import select
import sys

ANSWER_S = 10.0


def main(port: int, every_s: float) -> None:
    line = http.client.HTTPConnection("127.0.0.1", port, timeout=ANSWER_S)
    headers = {"authorization": f"Bearer {os.environ['URC_BENCH_KEY']}"}
    while not select.select([sys.stdin], [], [], every_s)[0]:
        line.request("GET", "/api/v1/robots", headers=headers)
        robots = json.loads(line.getresponse().read())["robots"]
        lost = sum(one["state"] == "lost" for one in robots)
        print("list", len(robots), lost, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
