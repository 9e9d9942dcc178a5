"""The baseline of `fanout`, a loop of sends: ``fan_plain.py CLIENTS SIZE FRAMES RATE``.

The program accepts the clients, answers each handshake with status 101, and sends frames to each
client at the given rate. The program prints its port at the start, and its processor time in
seconds at the end.
"""

import socket
import sys
import time

HEAD_BYTES = 4


def accepted(server: socket.socket) -> socket.socket:
    """Accept a client and answer its handshake, so that the next client can connect."""
    page, _ = server.accept()
    page.recv(4096)
    page.sendall(b"HTTP/1.1 101 Switching Protocols\r\n\r\n")
    return page


def main() -> None:
    clients, size, frames, rate_hz = map(int, sys.argv[1:])
    body = b"x" * (size - HEAD_BYTES)
    frame = bytes([0x81, 126]) + len(body).to_bytes(2, "big") + body
    with socket.create_server(("127.0.0.1", 0), backlog=clients) as server:
        print(server.getsockname()[1], flush=True)
        pages = [accepted(server) for _ in range(clients)]
    began_s = time.process_time()
    for _ in range(frames):
        for page in pages:
            page.sendall(frame)
        time.sleep(1 / rate_hz)
    print(time.process_time() - began_s, flush=True)


if __name__ == "__main__":
    main()
