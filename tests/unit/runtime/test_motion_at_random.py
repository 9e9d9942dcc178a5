"""The desk over many random steps of many screens."""

from random import Random

from tests.unit.runtime.desks import Scene


def test_over_ten_thousand_random_steps_no_two_screens_move_the_robot() -> None:
    """Between the motion of one screen and that of another there is always a stop."""
    dice = Random(5)  # noqa: S311 - it is no secret
    it = Scene()
    mine = {"ann": 0.1, "bob": 0.2, "eve": 0.3}
    moving = ""
    for _ in range(10_000):
        who = dice.choice(tuple(mine))
        step = dice.randrange(12)
        if step < 6:
            it.tick(who, speed=mine[who])
        elif step < 9:
            it.drive(who, dice.choice(("take", "ask", "yes", "no", "force", "leave", "reset")))
        elif step == 9:
            it.controller.release(who, "drive")
            it.controller.stopped("drive", "released")
        elif step == 10:
            it.controller.stopped("drive", dice.choice(("expired", "revoked")))
            moving = ""
        else:
            it.now += dice.choice((0.1, 1.0, 70.0))
            it.controller.expire(it.now)
            if dice.random() < 0.1:
                it.controller.stop(who)
        for told in it.heard():
            if told.startswith(("stop", "release")):
                moving = ""
            elif told.startswith("drive"):
                driver = next(name for name, speed in mine.items() if told.endswith(str(speed)))
                assert moving in ("", driver)
                moving = driver
