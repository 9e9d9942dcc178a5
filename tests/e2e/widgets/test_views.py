"""What the widgets that look at the world show: values pushed, pixels and words seen."""

import re
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_attribute, until_text
from tests.e2e.drawn import BLUE, GREEN, GREY, PIXELS_OF, RED, plain, png, until_pixel, until_seen
from tests.e2e.gallery import coarse, difference
from tests.e2e.motion.driving import CALM_LEASE_S, Wire, centre, driven, fresh, held, number
from tests.e2e.widgets.inputs import drag
from tests.e2e.widgets.viewing import METRES, RESTED, shown
from urc.model.driver import Argument, Command
from urc.model.interface import WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

BESIDE = """() => {
  const face = document.querySelector(".scan-face").getBoundingClientRect();
  const words = document.querySelector(".scan-scale").getBoundingClientRect();
  const [x, y] = [face.left + face.width / 2, face.top + face.height / 2];
  const dx = Math.max(words.left - x, x - words.right, 0);
  const dy = Math.max(words.top - y, y - words.bottom, 0);
  return words.width > 0 && Math.hypot(dx, dy) >= Math.min(face.width, face.height) / 2 - 1;
}"""
"""Whether the figure of the scale lies outside the rings."""


def told(name: str, *arguments: str, kind: Any = "number") -> Command:
    """Return a command that is given once."""
    return Command(
        name, "wire", WriteSpec("text"), {each: Argument(each, kind) for each in arguments}
    )


async def test_distances_around_the_robot(new_page: PageMaker) -> None:
    """The nearest counts, in words and shape; a sweep is drawn where things are, in every view."""
    signals = {**METRES, "sweep": Signal("sweep", "array", unit="m", stale_after_s=60)}
    uses = (
        WidgetUse(
            "r",
            "range",
            {"range": "front"},
            options={"view": "ring", "near": 1.0, "stop": 0.5, "max": 4},
            lists={"others": ("rear",)},
        ),
        WidgetUse("s", "scan", {"ranges": "sweep"}, options={"range_max": 10, "stop": 3.0}),
    )
    page = await new_page(size="tablet")
    async with shown(page, signals, *uses) as robot:
        robot.set_reading("front", 2.0)
        robot.set_reading("rear", 0.4)
        await until_text(page, ".range-text", "0.40")
        assert await page.inner_text(".range-note") == "▲ very near · behind"
        assert await page.locator(".range-wall[data-zone='stop']").count() == 1
        robot.set_reading("rear", 4.0)
        robot.set_reading("front", float("nan"))
        await until_text(page, ".range-text", "clear")
        assert await page.locator(".range-free").count() == 1, "what is not known is not drawn"
        # Behind 8, right 5, ahead 2, left not known.
        robot.set_reading("sweep", (8.0, 5.0, 2.0, None))  # type: ignore[arg-type]
        await until_text(page, ".scan-text", "▲ 2.00 m · ahead")
        await until_pixel(page, ".scan-data", 0.5, 0.4, "r > 120 && r > b + 40 && a === 255")
        await until_pixel(page, ".scan-data", 0.75, 0.5, "a === 255 && Math.abs(r - b) < 40")
        await until_pixel(page, ".scan-data", 0.25, 0.5, "a === 0")
        await until_text(page, ".scan-scale", "◯ 5 m")
        assert await page.evaluate(BESIDE), "the figure covers obstacles"
        button = page.get_by_role("button", name="View: Dots")
        await button.click()
        await until_attribute(page, ".scan", "data-view", "map")
        await until_pixel(page, ".scan-data", 0.6, 0.5, "a === 255")
        for name in ("graph", "depth", "arc"):
            await page.locator(".scan-view").click()
            await until_attribute(page, ".scan", "data-view", name)
        await until_text(page, ".scan-scale", "")
        # On the arc: ahead is near and so bright and yellow, cividis' upper end.
        await until_pixel(page, ".scan-data", 0.5, 0.12, "a === 255 && r > 170 && r > b + 60")


async def test_rays_at_uneven_angles_are_drawn_where_they_look(new_page: PageMaker) -> None:
    """Degrees of the robot become directions; angles that cannot be right draw nothing."""
    signals = {
        "sweep": Signal("sweep", "array", unit="m", stale_after_s=60),
        "ways": Signal("ways", "array", unit="deg", stale_after_s=60),
    }
    use = WidgetUse(
        "s",
        "scan",
        {"ranges": "sweep", "angles": "ways"},
        options={"range_max": 10, "stop": 3.0, "fit": False},
    )
    page = await new_page(size="tablet")
    async with shown(page, signals, use) as robot:
        ahead, right, behind_left = (0.5, 0.4), (0.75, 0.5), (0.5 + 0.2 * -0.866, 0.5 + 0.2 * 0.5)
        robot.set_reading("sweep", (2.0, 5.0, 4.0))  # type: ignore[arg-type]
        await until_text(page, ".scan-note", "no angles yet")
        assert await page.inner_text(".scan-text") == "—"
        robot.set_reading("ways", (0.0, -90.0, 120.0))  # type: ignore[arg-type]
        await until_text(page, ".scan-text", "▲ 2.00 m · ahead")
        await until_pixel(page, ".scan-data", *ahead, "r > 120 && r > b + 40 && a === 255")
        for x, y in (right, behind_left):
            await until_pixel(page, ".scan-data", x, y, "a === 255 && Math.abs(r - b) < 40")
        # Where even steps would have put the second and the third.
        await until_pixel(page, ".scan-data", 0.5 + 0.25 * 0.866, 0.5 - 0.25 * 0.5, "a === 0")
        await until_pixel(page, ".scan-data", 0.5 - 0.2 * 0.866, 0.5 - 0.2 * 0.5, "a === 0")
        robot.set_reading("ways", (0.0, -90.0))  # type: ignore[arg-type]
        await until_text(page, ".scan-note", "▲ 2 angles for 3 distances")
        for x, y in (ahead, right, behind_left):
            await until_pixel(page, ".scan-data", x, y, "a === 0")
        assert await page.inner_text(".scan-text") == "—"
        assert await page.get_attribute(".scan", "data-zone") == ""
        robot.set_reading("ways", (0.0, None, 120.0))  # type: ignore[arg-type]
        await until_text(page, ".scan-note", "▲ angle 2 of 3 is not a number")
        await until_pixel(page, ".scan-data", *ahead, "a === 0")
        robot.set_reading("ways", (0.0, -90.0, 90.0))  # type: ignore[arg-type]
        await until_text(page, ".scan-text", "▲ 2.00 m · ahead")
        assert await page.inner_text(".scan-note") == ""
        await page.get_by_role("button", name="View: Dots").click()
        await until_attribute(page, ".scan", "data-view", "map")
        await until_pixel(page, ".scan-data", 0.4, 0.5, "a > 0")  # free, up to the wall on the left
        await until_pixel(page, ".scan-data", 0.5, 0.6, "a === 0")  # no ray looks behind
        robot.set_reading("ways", (0.0, 180.0, 90.0))  # type: ignore[arg-type]
        await until_pixel(page, ".scan-data", 0.5, 0.6, "a > 0")
        await until_pixel(page, ".scan-data", 0.6, 0.5, "a === 0")


async def test_depth_is_coloured_and_probed(new_page: PageMaker) -> None:
    """16 bits of millimetres: near is bright; a tap and a key choose what is measured and sent."""
    use = WidgetUse(
        "d", "depth", {"image": "depth"}, {"probe": "look"}, {"near": 0, "far": 4, "fit": "contain"}
    )
    signals = {"depth": Signal("depth", "image", stale_after_s=60)}
    commands = {"look": told("look", "x", "y", "distance")}
    page = await new_page(size="tablet")
    async with shown(page, signals, use, commands=commands) as robot:
        rows = [[400] * 8 + [3600] * 8 for _ in range(8)]
        robot.set_reading("depth", png(rows))
        await until_text(page, ".depth-text", "3.60 m · 8, 4")
        await until_pixel(page, ".depth-data", 0.2, 0.5, "r > 200 && b < 100")
        await until_pixel(page, ".depth-data", 0.8, 0.5, "r < 60 && b > 80")
        box = await page.locator(".depth-face").bounding_box()
        assert box is not None
        scale = min(box["width"] / 16, box["height"] / 8)
        middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        await page.mouse.click(middle[0] - 5.5 * scale, middle[1] + 0.5 * scale)
        await until(lambda: len(robot.commands) == 1)
        assert robot.commands[0] == ("look", {"x": 2, "y": 4, "distance": 0.4})
        await until_text(page, ".depth-text", "0.40 m · 2, 4")
        await drag(page, ".depth-note", 0, 0)
        await page.mouse.move(middle[0], middle[1], steps=3)
        await page.mouse.up()
        await page.mouse.click(middle[0], middle[1], button="right")
        await page.locator(".depth-face").focus()
        for _ in range(5):
            await page.keyboard.press("ArrowRight")
        await until_text(page, ".depth-text", "0.40 m · 4, 4")
        await page.keyboard.press("Enter")
        await until(lambda: len(robot.commands) > 1)
        assert robot.commands[1:] == [("look", {"x": 4, "y": 4, "distance": 0.4})], (
            "a press that began elsewhere, or with another button, chose nothing"
        )
        robot.set_reading("depth", b"not a picture")
        await page.wait_for_selector(".depth[data-fault='yes']")
        assert "set the options width and height" in await page.inner_text(".depth-note")


async def test_a_camera_shows_the_newest_picture_and_its_age(new_page: PageMaker) -> None:
    """Newest wins; several are switched; a freeze says how old it is; the picture can be kept."""
    signals = {
        name: Signal(name, "image", title=name.title(), stale_after_s=60)
        for name in ("front", "arm")
    }
    use = WidgetUse(
        "c",
        "camera",
        options={"fit": "fill", "crosshair": True, "mirror": True},
        lists={"images": ("front", "arm")},
    )
    page = await new_page(size="tablet")
    async with shown(page, signals, use) as robot:
        await until_text(page, ".camera-note", "no picture yet")
        halves = png([[RED] * 4 + [BLUE] * 4] * 6)
        robot.set_reading("front", halves)
        robot.set_reading("arm", plain(GREEN))
        # Mirrored: what is left in the picture is right on the screen.
        await until_seen(page, ".camera-face", 0.9, 0.6, RED)
        await until_seen(page, ".camera-face", 0.1, 0.6, BLUE)
        async with page.expect_download() as started:
            await page.get_by_role("button", name="Save picture").click()
        download = await started.value
        assert download.suggested_filename.endswith(".png")
        assert Path(await download.path()).read_bytes().startswith(b"\x89PNG")
        await page.get_by_role("button", name="Arm").click()
        await until_seen(page, ".camera-face", 0.1, 0.6, GREEN)
        robot.set_reading("arm", plain(GREY), age_s=5.0)
        await until_seen(page, ".camera-face", 0.1, 0.6, GREY)
        await page.wait_for_selector(".camera[data-frozen='yes']")
        assert "s old" in await page.inner_text(".camera-age")
        robot.set_reading("arm", b"GIF89a broken")
        await until_text(page, ".camera-note", "▲ this picture is damaged: image/gif, 13 bytes")


class Watcher(Wire):
    """A robot with a camera that turns."""

    def __init__(self) -> None:
        use = WidgetUse("c", "camera", {"image": "front"}, {"look": "aim"})
        aim = held("aim", number("pan"), number("tilt"), lease_s=CALM_LEASE_S)
        signals = {"front": Signal("front", "image", stale_after_s=60)}
        profile = dashboard_profile(signals=signals, uses=(use,), commands={"aim": aim})
        FakeRobot.__init__(self, profile)


async def test_a_camera_is_turned_by_dragging_its_picture(new_page: PageMaker) -> None:
    """Held like a stick: it turns for as long as it is dragged, and letting go stops it."""
    robot = Watcher()
    async with driven(robot=robot) as (_, address):
        page = await fresh(new_page, "desktop")
        await page.goto(address)
        await page.wait_for_selector(".camera:not([data-locked])")
        x, y = await centre(page, ".camera-face")
        await page.mouse.move(x, y)
        await page.mouse.down()
        await page.mouse.move(x + 2000, y, steps=2)
        await until(lambda: robot.values("aim") == {"pan": 1.0, "tilt": 0.0})
        await page.mouse.up()
        await robot.until_stopped("aim")
        await page.locator(".camera-face").focus()
        await page.keyboard.down("ArrowDown")
        await until(lambda: robot.values("aim") == {"pan": 0.0, "tilt": -0.5})
        await page.keyboard.up("ArrowDown")
        await robot.until_stopped("aim")


DEGREES = {
    name: Signal(name, "number", unit="deg", stale_after_s=60) for name in ("lat", "lon", "head")
}


async def test_a_place_on_the_map_is_asked_for_before_it_is_sent(new_page: PageMaker) -> None:
    """Tap, question, command; a way likewise, twice asked; nothing beyond the fence."""
    fence = [[46.51, 6.56], [46.51, 6.58], [46.53, 6.58], [46.53, 6.56]]
    use = WidgetUse(
        "m",
        "map",
        {"latitude": "lat", "longitude": "lon", "heading": "head"},
        {"goto": "go", "waypoints": "follow"},
        {"format": "dms", "fence": fence},
    )
    commands = {
        "go": told("go", "latitude", "longitude"),
        "follow": told("follow", "latitudes", "longitudes", kind="array"),
    }
    page = await new_page(size="desktop")
    async with shown(page, DEGREES, use, commands=commands) as robot:
        for name, value in (("lat", 46.52), ("lon", 6.57), ("head", 90.0)):
            robot.set_reading(name, value)
        await until_text(page, ".map-text", "46°31′12.0″ N, 6°34′12.0″ E")
        turn = "document.querySelector('.map-arrow').style.transform"
        await page.wait_for_function(f"() => {turn} === 'rotate(90deg)'")
        await until_text(page, ".map-heading", "· heading 090°")
        await expect(page.locator(".map-north")).to_be_visible()
        area = page.locator(".map-area")
        await area.focus()
        await page.keyboard.press("Enter")
        await page.wait_for_selector(".map-bar[data-mode='place']:not([hidden])")
        await expect(page.locator(".map-words")).to_contain_text("Go to 46°31′12.0″ N")
        assert robot.commands == []
        await page.get_by_role("button", name="Go there").click()
        await until(lambda: len(robot.commands) == 1)
        name, arguments = robot.commands[0]
        assert name == "go"
        assert abs(float(arguments["latitude"]) - 46.52) < 1e-3  # type: ignore[arg-type]
        assert abs(float(arguments["longitude"]) - 6.57) < 1e-3  # type: ignore[arg-type]
        await until_text(page, ".map-words", "✓ sent")
        await page.get_by_role("button", name="Draw a route").click()
        x, y = await centre(page, ".map-area")
        for right in (-80, 80):
            await page.mouse.click(x + right, y)
        await page.wait_for_function(
            "() => /^2 /.test(document.querySelector('.map-words').textContent)"
        )
        await page.get_by_role("button", name="Send …").click()
        await expect(page.locator(".map-words")).to_contain_text(
            "Send the robot to 2 places in order"
        )
        await page.get_by_role("button", name="Send", exact=True).click()
        await until(lambda: len(robot.commands) == 2)
        way = robot.commands[1][1]
        west, east = way["longitudes"]  # type: ignore[misc]
        assert west < 6.57 < east
        assert len(way["latitudes"]) == 2  # type: ignore[arg-type]
        robot.set_reading("lat", 46.6)
        await page.wait_for_selector(".map[data-fence='out']")
        await area.focus()
        await page.keyboard.press("Enter")
        await until_text(page, ".map-words", "▲ outside the fence")
        assert await page.get_by_role("button", name="Go there").is_disabled()
        await page.keyboard.press("Escape")
        await page.wait_for_selector(".map[data-mode='look']")


async def test_a_trail_is_cleared_by_its_button_and_by_a_jump_of_the_position(
    new_page: PageMaker,
) -> None:
    """There is nothing to clear before the robot has moved."""
    signals = {name: Signal(name, "number", unit="m", stale_after_s=60) for name in ("px", "py")}
    page = await new_page(size="desktop")
    async with shown(page, signals, WidgetUse("m", "map", {"x": "px", "y": "py"})) as robot:
        clear = page.get_by_role("button", name="Clear the trail")

        async def move(x: float) -> None:
            robot.set_reading("px", x)
            await until_text(page, ".map-text", f"x {x:.2f} m, y 0.00 m")

        robot.set_reading("py", 0.0)
        await move(0.0)
        await expect(page.locator(".map-north")).to_be_hidden()
        await expect(page.locator(".map-bar-length")).to_have_text(re.compile(r"^[125]0*\.?0? m$"))
        await expect(clear).to_be_hidden()
        await move(0.5)
        await clear.click()
        await expect(clear).to_be_hidden()
        await move(1.0)
        await expect(clear).to_be_visible()
        await move(500.0)
        await expect(clear).to_be_hidden()


async def test_a_map_of_a_floor_has_metres(new_page: PageMaker) -> None:
    """x and y in place of latitude and longitude; a tap gives metres, 32 pixels to one."""
    signals = {name: Signal(name, "number", unit="m", stale_after_s=60) for name in ("px", "py")}
    use = WidgetUse("m", "map", {"x": "px", "y": "py"}, {"goto": "go"})
    page = await new_page(size="desktop")
    async with shown(page, signals, use, commands={"go": told("go", "x", "y")}) as robot:
        robot.set_reading("px", 1.5)
        robot.set_reading("py", -2.0)
        await until_text(page, ".map-text", "x 1.50 m, y -2.00 m")
        x, y = await centre(page, ".map-area")
        await page.mouse.click(x + 64, y - 32)
        await page.get_by_role("button", name="Go there").click()
        await until(lambda: len(robot.commands) == 1)
        place = robot.commands[0][1]
        assert abs(float(place["x"]) - 3.5) < 0.1  # type: ignore[arg-type]
        assert abs(float(place["y"]) + 1.0) < 0.1  # type: ignore[arg-type]


async def test_a_robot_leaves_a_trail_on_the_map(new_page: PageMaker) -> None:
    """Two metres to the east and one back: the line stays while the map follows the robot."""
    signals = {name: Signal(name, "number", unit="m", stale_after_s=60) for name in ("px", "py")}
    use = WidgetUse("m", "map", {"x": "px", "y": "py"}, options={"trail_step": 0.2})
    page = await new_page(size="desktop")
    async with shown(page, signals, use) as robot:
        robot.set_reading("py", 0.1)  # off the axes of the grid
        for step in (*range(11), *range(9, 4, -1)):
            robot.set_reading("px", step / 5)
            await until_text(page, ".map-text", f"x {step / 5:.2f} m, y 0.10 m")
        x, y = await centre(page, ".map-area")
        for left in (-25, 20):  # behind the robot, and where it came back from
            clip = {"x": x + left, "y": y - 4, "width": 4, "height": 8}
            picture = Image.open(BytesIO(await page.screenshot(clip=clip))).convert("L")  # type: ignore[arg-type]
            assert picture.getextrema()[0] < 140, left  # type: ignore[operator]


async def test_a_panorama_is_looked_around_in(new_page: PageMaker) -> None:
    """What is left in the picture is to the left; a drag and keys turn; the flat one agrees."""
    signals = {"around": Signal("around", "image", stale_after_s=60)}
    uses = (
        WidgetUse("ball", "pano360", {"image": "around"}, {"capture": "take"}),
        WidgetUse("flat", "pano360", {"image": "around"}, options={"flat": True}),
    )
    quarters = [RED] * 16 + [GREEN] * 16 + [BLUE] * 16 + [GREY] * 16
    page = await new_page(size="desktop")
    commands = {"take": Command("take", "wire", WriteSpec("text"))}
    async with shown(page, signals, *uses, commands=commands) as robot:
        robot.set_reading("around", png([quarters] * 32))
        faces = [f"[data-cell='{cell}'] .pano360-face" for cell in (0, 1)]
        for cell, face in enumerate(faces):
            where = f"[data-cell='{cell}'] .pano360-where"
            await until_text(page, where, "ahead")
            await page.locator(face).focus()
            for _ in range(9):
                await page.keyboard.press("ArrowLeft")
            await until_text(page, where, "left 45°")
        # 45° to the left is the middle of the second quarter: green; further left is red.
        await page.wait_for_function(COLOUR, arg=[faces[1], 0.5, "g"])
        ball, flat = await coarse(page, faces)
        assert difference(ball, flat) < 25
        x, y = await centre(page, faces[1])
        await page.mouse.move(x, y)
        await page.mouse.down()
        await page.mouse.move(x + 5000, y, steps=4)
        await page.mouse.up()
        await page.wait_for_function(
            "() => !/left 45/.test(document.querySelector(\"[data-cell='1'] .pano360-where\")"
            ".textContent)"
        )
        await page.get_by_role("button", name="Capture").click()
        await until(lambda: robot.commands == [("take", {})])


COLOUR = f"""
([face, x, wanted]) => {{
  const {{ width, height, data }} = ({PIXELS_OF})(document.querySelector(`${{face}} canvas`));
  const place = 4 * (Math.floor(height / 2) * width + Math.floor(width * x));
  const [r, g, b] = data.slice(place, place + 3);
  return wanted === "g" ? g > 150 && r < 60 && b < 60 : r > 150 && g < 60;
}}
"""


async def test_a_model_bends_as_the_robot_does(new_page: PageMaker, tmp_path: Path) -> None:
    """The model comes from the robot's folder; a joint moves it; nothing new draws nothing."""
    (tmp_path / "arm.urdf").write_text(ARM, "utf-8")
    signals = {"elbow": Signal("elbow", "number", unit="rad", stale_after_s=60)}
    use = WidgetUse(
        "arm",
        "scene3d",
        options={"urdf": "arm.urdf", "view": "top"},
        lists={"joint": ("elbow",)},
        files={"arm.urdf": str(tmp_path / "arm.urdf")},
    )
    page = await new_page(size="desktop")
    async with shown(page, signals, use) as robot:
        await page.wait_for_selector(".scene3d[data-model='urdf']")
        robot.set_reading("elbow", 0.0)
        await until_text(page, ".scene3d-joints", "joints: 1")
        drawn = "document.querySelector('.scene3d-picture').dataset.frames"
        # It comes to rest: twenty frames of the page without one of the scene.
        before = await page.evaluate(RESTED)
        assert before == await page.evaluate(drawn)
        straight = (await coarse(page, [".scene3d-face"]))[0]
        robot.set_reading("elbow", 1.57)
        await page.wait_for_function(f"(before) => {drawn} !== before", arg=before)
        await page.evaluate(RESTED)
        bent = (await coarse(page, [".scene3d-face"]))[0]
        moved = [
            abs(one - other)
            for row, other_row in zip(straight, bent, strict=True)
            for one, other in zip(row, other_row, strict=True)
        ]
        assert max(moved) > 20


async def test_the_model_comes_from_the_description_that_the_robot_sends(
    new_page: PageMaker,
) -> None:
    """A text that is no model is named, and the next one is shown."""
    signals = {
        "elbow": Signal("elbow", "number", unit="rad", stale_after_s=60),
        "urdf": Signal("urdf", "string", stale_after_s=60),
    }
    use = WidgetUse("arm", "scene3d", {"description": "urdf"}, lists={"joint": ("elbow",)})
    page = await new_page(size="desktop")
    async with shown(page, signals, use) as robot:
        await page.wait_for_selector(".scene3d[data-model='box']")
        robot.set_reading("elbow", 0.0)
        robot.set_reading("urdf", ARM)
        await page.wait_for_selector(".scene3d[data-model='urdf']")
        await until_text(page, ".scene3d-joints", "joints: 1")
        robot.set_reading("urdf", "<robot")
        await page.wait_for_selector(".scene3d[data-model='box']")
        await until_text(page, ".scene3d-note", "▲ the model is no XML")
        robot.set_reading("urdf", ARM)
        await page.wait_for_selector(".scene3d[data-model='urdf']")
        await until_text(page, ".scene3d-note", "")


ARM = """\
<robot name="arm">
  <link name="base"><visual><geometry><box size="0.4 0.4 0.2"/></geometry></visual></link>
  <link name="fore">
    <visual><origin xyz="1 0 0"/><geometry><box size="2 0.3 0.3"/></geometry></visual>
  </link>
  <joint name="elbow" type="revolute">
    <parent link="base"/><child link="fore"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
</robot>
"""
