"""Clients that wait for the same get it in one loop, and nobody gets a frame twice or torn."""

import json

from urc.model.values import Sample, Signal
from urc.runtime.hub import Hub, Note
from urc.testing.clock import FakeClock
from urc.web.feed.crowd import Place
from urc.web.feed.fanout import Fanout

JPEG = b"\xff\xd8\xff\xe0 and so on"


class Room:
    """Takes what is written by number, as much of it as it has room for."""

    def __init__(self) -> None:
        self.taken: dict[int, bytes] = {}
        self.room: dict[int, int] = {}
        """Of those that are full or gone."""
        self.is_gone: set[int] = set()

    def write(self, number: int, data: bytes) -> int:
        if number in self.is_gone:
            raise BrokenPipeError
        size = min(len(data), self.room.get(number, len(data)))
        if size == 0:
            raise BlockingIOError
        self.taken[number] = self.taken.get(number, b"") + data[:size]
        return size


class Scene:
    """A robot with a number and a camera, and clients that wait for nothing but news."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.hub = Hub({"a": Signal("a"), "cam": Signal("cam", "image")})
        self.kernel = Room()
        self.fanout = Fanout(self.hub, clock=self.clock, write=self.kernel.write)

    def say(self, **values: float | bytes) -> None:
        self.hub.put([Sample(name, value, self.clock.now()) for name, value in values.items()])
        self.fanout.flush()


class Client:
    """A client with a socket of this number; the transport takes what the kernel does not."""

    def __init__(self, scene: Scene, number: int, *shown: str) -> None:
        self.scene, self.fanout = scene, scene.fanout
        self.woken = 0
        self.left = b""
        self.place: Place = self.fanout.join(self)
        self.place.number = number
        self.place.finish = self.finish
        self.place.looks.show(shown)
        self.fanout.take(self.place)
        self.fanout.settle(self.place)

    def wake(self) -> None:
        """Take what is new by itself, and be ready again."""
        self.woken += 1
        data = self.fanout.take_frames(self.place)
        number = self.place.number
        self.scene.kernel.taken[number] = self.scene.kernel.taken.get(number, b"") + data
        self.fanout.settle(self.place)

    def finish(self, rest: bytes) -> None:
        self.left += rest
        self.fanout.stir(self.place)

    @property
    def frames(self) -> list[bytes]:
        """What came, without its heads; images begin at their bytes."""
        data = self.scene.kernel.taken.get(self.place.number, b"") + self.left
        found = []
        while data:
            size, at = data[1], 2
            if size == 126:
                size, at = int.from_bytes(data[2:4]), 4
            body, data = data[at : at + size], data[at + size :]
            found.append(body if body.startswith(b"{") else body[body.index(JPEG[:3]) :])
        return found

    @property
    def values(self) -> list[object]:
        return [json.loads(frame)["v"][0] for frame in self.frames if frame.startswith(b"{")]


def test_a_settled_client_is_written_to_and_never_woken() -> None:
    """Everybody in the crowd gets each frame, once."""
    it = Scene()
    ann, bob = Client(it, 7), Client(it, 8)
    for value in (1, 2, 3):
        it.say(a=value)
    assert ann.values == bob.values == [1, 2, 3]
    assert (ann.woken, bob.woken) == (0, 0)


def test_a_client_that_is_stirred_goes_on_where_the_crowd_was() -> None:
    """What it got there it does not get again, and it misses nothing."""
    it = Scene()
    ann, bob = Client(it, 7), Client(it, 8)
    it.say(a=1)
    it.fanout.stir(ann.place)
    it.say(a=2)
    it.say(a=3)
    assert ann.values == bob.values == [1, 2, 3]
    assert ann.woken == 1  # and was settled again


def test_what_the_kernel_does_not_take_goes_to_the_transport_and_no_frame_is_torn() -> None:
    """The rest follows the part; meanwhile nothing is written past it."""
    it = Scene()
    ann, bob = Client(it, 7), Client(it, 8)
    it.kernel.room[7] = 5
    it.say(a=1)
    assert len(it.kernel.taken[7]) == 5
    assert ann.place.crowd is None
    it.kernel.room.clear()
    assert ann.values == bob.values == [1]


def test_a_full_or_lost_line_is_the_transports_business() -> None:
    """The others get the frame all the same, and what nobody took was given to the transport."""
    it = Scene()
    ann, bob, cy = Client(it, 7), Client(it, 8), Client(it, 9)
    it.kernel.room[7] = 0
    it.kernel.is_gone.add(8)
    it.say(a=1)
    assert cy.values == [1]
    assert ann.left == bob.left == it.kernel.taken[9]


def test_one_that_has_got_less_far_is_woken_once_and_settled_then() -> None:
    """A crowd has one place: who is behind comes up to it by itself."""
    it = Scene()
    ann = Client(it, 7)
    it.say(a=1)
    late = Client(it, 8)
    it.fanout.stir(late.place)
    it.say(a=2)
    it.say(a=3)
    assert ann.values == [1, 2, 3]
    assert late.values[-2:] == [2, 3]
    assert late.place.crowd is ann.place.crowd is not None


def test_images_go_to_those_who_show_them_and_once_each() -> None:
    """They are another crowd, which gets the values too."""
    it = Scene()
    ann, bob = Client(it, 7), Client(it, 8, "cam")
    it.say(cam=JPEG)
    it.say(a=1)
    assert ann.frames == bob.frames[1:]
    assert bob.frames[0] == JPEG
    it.fanout.stir(bob.place)
    assert it.fanout.shelf.take(bob.place.looks) is None


def test_an_image_beside_a_value_follows_its_frame() -> None:
    """However many cameras are shown; no image comes once more with the next value."""
    it = Scene()
    ann, bob, cy = Client(it, 7), Client(it, 8, "cam"), Client(it, 9, "cam")
    it.say(cam=JPEG + b"1", a=1)
    it.say(a=2)
    it.say(cam=JPEG + b"2")
    assert ann.values == bob.values == [1, 2]
    assert [frame for frame in bob.frames if frame.startswith(JPEG)] == [JPEG + b"1", JPEG + b"2"]
    assert bob.frames == cy.frames


def test_a_lone_crowd_gets_images_and_values_in_turn() -> None:
    """It goes a shorter way, with the same at its end."""
    it = Scene()
    ann = Client(it, 7, "cam")
    it.say(cam=JPEG)
    it.say(cam=JPEG + b"2", a=1)
    it.hub.put([Sample("a", 2, it.clock.now())])
    it.say(a=3)
    assert ann.woken == 0
    assert ann.values == [1, 3]
    assert [frame for frame in ann.frames if frame.startswith(JPEG)] == [JPEG, JPEG + b"2"]


def test_lines_of_the_log_come_beside_streaming_values() -> None:
    """A lone client gets them with the next values, not when those have an end."""
    it = Scene()
    ann = Client(it, 7)
    it.say(a=1)
    for value in (2, 3):
        it.hub.note(Note(it.clock.now(), "warning", "wire", f"line {value}"))
        it.say(a=value)
        assert f"line {value}".encode() in it.kernel.taken[7]
    assert [json.loads(frame)["t"] for frame in ann.frames] == ["v", "v", "log", "v", "log"]


def test_a_camera_that_has_nothing_any_more_is_a_value() -> None:
    """The page is told so; it has the last image already."""
    it = Scene()
    ann = Client(it, 7, "cam")
    it.say(cam=JPEG)
    it.hub.put([Sample("cam", None, it.clock.now())])
    it.fanout.flush()
    assert ann.values == [None]
    assert ann.frames[0] == JPEG


def test_the_end_wakes_everybody() -> None:
    """Whoever was settled learns that there is nothing more to come."""
    it = Scene()
    ann = Client(it, 7)
    it.fanout.end()
    assert ann.woken == 1


def test_nobody_is_written_to_after_it_has_left() -> None:
    """Its number may be another one's by then."""
    it = Scene()
    ann = Client(it, 7)
    it.fanout.leave(ann.place)
    it.say(a=1)
    assert not it.kernel.taken
    assert ann.woken == 0


def test_a_line_without_a_number_is_always_woken() -> None:
    """Where sockets are no files, clients write by themselves."""
    it = Scene()
    ann = Client(it, -1)
    it.say(a=1)
    assert ann.woken == 1
