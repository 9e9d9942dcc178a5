"""A slow, lossy or interrupted link between network namespaces: a separate program.

The program needs Linux, root and /dev/net/tun, and imports nothing from URC. ``python
relay_process.py abc`` creates three namespaces with a TUN device each, and forwards packets between
the devices; without the argument, there are the sides ``a`` and ``b``. Side ``a`` has the address
10.77.0.1, side ``b`` has 10.77.0.2 and so on, and each has its own loopback.
``nsenter --net=/proc/PID/fd/FD`` starts other programs in a namespace. The program reports on
standard output::

    ready FD_A FD_B …       descriptors of the namespaces in this process
    done TIME               the last order was executed, monotonic nanoseconds

Orders on standard input, one per line, with times in milliseconds::

    delay MS | jitter MS | loss PERCENT
    rate KBIT               what each side can send, in kbit/s; 0 for no limit
    cut | heal              the whole link
    cut a | cut b           only packets from that side
    cut PORT | heal PORT    only packets from or to that TCP or UDP port
    cut PORT a              the same, only from that side; `heal PORT` ends it too
    down a | up a           the network interface of a side

The program ends when its standard input closes. A namespace is removed when its last program ends.
"""

import ctypes
import fcntl
import heapq
import os
import random
import selectors
import socket
import struct
import sys
import time
from collections import defaultdict
from dataclasses import dataclass, field

CLONE_NEWNET = 0x40000000
TUNSETIFF = 0x400454CA
IFF_TUN_NO_PI = 0x1001
SIOCSIFADDR, SIOCSIFNETMASK, SIOCGIFFLAGS, SIOCSIFFLAGS = 0x8916, 0x891C, 0x8913, 0x8914
IFF_UP = 1
DEVICE = b"tun0"
MOST_WAITING = 4096
"""Largest number of packets in transit; additional packets are lost, as on any link."""
MOST_QUEUED_NS = 1_000_000_000
"""Longest wait for a link with a rate, as in the buffers of many modems; further packets are lost.
"""


@dataclass
class Side:
    """One end of the link between the namespaces."""

    name: str
    namespace: int
    """File descriptor of the end's network namespace."""
    tun: int
    control: socket.socket
    """A socket inside the namespace, for configuring its network interfaces."""


@dataclass
class Weather:
    """The quality of the link: delay, loss and cuts."""

    delay_ns: int = 0
    jitter_ns: int = 0
    loss: float = 0.0
    bit_ns: float = 0.0
    """Time that a side needs to send one bit, in nanoseconds; 0 for a link without a rate."""
    free_ns: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    """Time at which a side has sent all its packets, keyed by side."""
    is_cut: dict[str, bool] = field(default_factory=lambda: defaultdict(bool))
    """Whether all packets that a side sends are lost, keyed by side."""
    ports: dict[str, set[int]] = field(default_factory=lambda: defaultdict(set))
    """Blocked ports of each side. A side's packets to or from a blocked port are lost."""


def made(name: str, address: str) -> Side:
    """Move this process into a new namespace; return its end of the link, with an active device."""
    if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNET) != 0:
        raise OSError(ctypes.get_errno(), "cannot create a network namespace; this needs root")
    tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tun, TUNSETIFF, struct.pack("16sH", DEVICE, IFF_TUN_NO_PI))
    control = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    _address(control, SIOCSIFADDR, address)
    _address(control, SIOCSIFNETMASK, "255.255.255.0")
    side = Side(name, os.open("/proc/self/ns/net", os.O_RDONLY), tun, control)
    switch(side, b"lo", is_up=True)
    switch(side, DEVICE, is_up=True)
    return side


def _address(control: socket.socket, request: int, address: str) -> None:
    packed = struct.pack("HH4s8x", socket.AF_INET, 0, socket.inet_aton(address))
    fcntl.ioctl(control, request, struct.pack("16s16s", DEVICE, packed))


def switch(side: Side, device: bytes, *, is_up: bool) -> None:
    """Switch a side's interface on or off."""
    answer = fcntl.ioctl(side.control, SIOCGIFFLAGS, struct.pack("16sh14x", device, 0))
    flags = struct.unpack("16sh14x", answer)[1]
    flags = flags | IFF_UP if is_up else flags & ~IFF_UP
    fcntl.ioctl(side.control, SIOCSIFFLAGS, struct.pack("16sh14x", device, flags))


def ports_of(packet: bytes) -> tuple[int, int]:
    """Return the two ports of a TCP or UDP packet over IPv4; zeros for any other packet."""
    if packet[0] >> 4 != 4 or packet[9] not in (socket.IPPROTO_TCP, socket.IPPROTO_UDP):
        return 0, 0
    head = (packet[0] & 0x0F) * 4
    if len(packet) < head + 4:
        return 0, 0
    source, target = struct.unpack_from("!HH", packet, head)
    return source, target


class Relay:
    """The loop that forwards packets between the sides and executes orders."""

    def __init__(self, sides: str) -> None:
        self.weather = Weather()
        self._dice = random.Random(7)  # noqa: S311 - the same losses in every run
        addresses = {name: f"10.77.0.{number}" for number, name in enumerate(sides, 1)}
        self._sides = {name: made(name, address) for name, address in addresses.items()}
        self._side_of = {socket.inet_aton(address): name for name, address in addresses.items()}
        self._waiting: list[tuple[int, int, str, str, bytes]] = []
        self._numbers = 0
        self._orders = b""
        self._selector = selectors.DefaultSelector()
        for side in self._sides.values():
            self._selector.register(side.tun, selectors.EVENT_READ, side)
        self._selector.register(0, selectors.EVENT_READ)
        tell("ready", *(side.namespace for side in self._sides.values()))

    def run(self) -> None:
        """Forward packets until standard input closes."""
        while True:
            wait_s = None
            if self._waiting:
                wait_s = max(0.0, (self._waiting[0][0] - time.monotonic_ns()) / 1e9)
            for key, _ in self._selector.select(wait_s):
                if key.fd != 0:
                    self._take(key.data)
                elif not self._obey():
                    return
            self._deliver()

    def _take(self, side: Side) -> None:
        for _ in range(64):
            try:
                packet = os.read(side.tun, 65536)
            except OSError:  # no more packets, or the interface is down
                return
            weather = self.weather
            lost = weather.is_cut[side.name] or len(self._waiting) >= MOST_WAITING
            lost = lost or not weather.ports[side.name].isdisjoint(ports_of(packet))
            target = self._side_of.get(packet[16:20]) if packet[0] >> 4 == 4 else None
            if lost or target is None or (weather.loss and self._dice.random() < weather.loss):
                continue
            sent_ns = self._sent_ns(side.name, len(packet))
            if sent_ns is None:
                continue
            due_ns = sent_ns + weather.delay_ns
            if weather.jitter_ns:
                due_ns += self._dice.randrange(weather.jitter_ns)
            self._numbers += 1
            heapq.heappush(self._waiting, (due_ns, self._numbers, side.name, target, packet))

    def _sent_ns(self, name: str, size: int) -> int | None:
        """Return when a side has sent a packet of `size` bytes; None if the packet is lost."""
        weather, now_ns = self.weather, time.monotonic_ns()
        if not weather.bit_ns:
            return now_ns
        begins_ns = max(now_ns, weather.free_ns[name])
        if begins_ns - now_ns > MOST_QUEUED_NS:
            return None
        weather.free_ns[name] = begins_ns + round(8 * size * weather.bit_ns)
        return weather.free_ns[name]

    def _deliver(self) -> None:
        now_ns = time.monotonic_ns()
        while self._waiting and self._waiting[0][0] <= now_ns:
            *_, name, packet = heapq.heappop(self._waiting)
            try:
                os.write(self._sides[name].tun, packet)
            except OSError:
                continue  # the interface is down, so the packet is lost

    def _obey(self) -> bool:
        data = os.read(0, 65536)
        *orders, self._orders = (self._orders + data).split(b"\n")
        for order in orders:
            self._do(order.decode().split())
            tell("done", time.monotonic_ns())
        return bool(data)

    def _do(self, words: list[str]) -> None:
        verb, what = words[0], words[1] if len(words) > 1 else ""
        weather = self.weather
        if verb == "delay":
            weather.delay_ns = int(float(what) * 1e6)
        elif verb == "jitter":
            weather.jitter_ns = int(float(what) * 1e6)
        elif verb == "loss":
            weather.loss = float(what) / 100
        elif verb == "rate":
            kbit = float(what)
            weather.bit_ns = 1e6 / kbit if kbit else 0.0
        elif verb in ("down", "up"):
            switch(self._sides[what], DEVICE, is_up=verb == "up")
        elif what.isdigit():
            for side in words[2:] or self._sides:
                ports = weather.ports[side]
                (ports.add if verb == "cut" else ports.discard)(int(what))
        else:
            for side in [what] if what else self._sides:
                weather.is_cut[side] = verb == "cut"
            if verb == "cut":  # packets in transit are lost too
                self._waiting = [one for one in self._waiting if not weather.is_cut[one[2]]]
                heapq.heapify(self._waiting)


def tell(*words: object) -> None:
    """Write one line."""
    os.write(1, (" ".join(map(str, words)) + "\n").encode())


if __name__ == "__main__":
    try:
        Relay(sys.argv[1] if len(sys.argv) > 1 else "ab").run()
    except OSError as error:
        sys.exit(f"relay_process: {error}")
