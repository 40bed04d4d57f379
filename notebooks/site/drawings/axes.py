"""Axes and signs of ISO 8855: a car from above, from the side and from behind, and a tyre."""

from __future__ import annotations

import math

from notebooks.site.drawings.svg import (
    BLUE,
    GREEN,
    GREY,
    INK,
    PALE,
    RED,
    arc,
    arrow,
    box,
    circle,
    line,
    page,
    symbol,
    text,
)


def from_above() -> str:
    """x forward, y left; steer, sideslip and yaw rate are positive to the left."""
    x, y, turn, slip = 330, 190, 18, 14
    wheels = [(x + 105, y - 52, turn), (x + 105, y + 52, turn), (x - 105, y - 52, 0), (x - 105, y + 52, 0)]
    drawn = [box(x, y, 300, 100, fill=PALE, round_by=16)]
    drawn += [box(*place[:2], 52, 17, place[2], fill="#fff") for place in wheels]
    drawn += [circle(x, y, 5, INK), arrow(x, y, x + 235, y), symbol(x + 250, y + 5, "x")]
    drawn += [arrow(x, y, x, y - 135), symbol(x, y - 143, "y")]
    ahead = math.radians(slip)
    drawn += [arrow(x, y, x + 200 * math.cos(ahead), y - 200 * math.sin(ahead), BLUE, 2.5)]
    drawn += [symbol(x + 208 * math.cos(ahead), y - 212 * math.sin(ahead), "v", BLUE)]
    drawn += [arc(x, y, 120, 0, slip, BLUE), symbol(x + 136, y - 12, "β", BLUE)]
    drawn += [arc(x, y, 40, 200, 330, RED), text(x + 2, y + 66, "yaw_rate", RED)]
    wheel_x, wheel_y = x + 105, y - 52
    drawn += [line(wheel_x, wheel_y, wheel_x + 95, wheel_y, GREY, 1, "4 4")]
    tip = (wheel_x + 95 * math.cos(math.radians(turn)), wheel_y - 95 * math.sin(math.radians(turn)))
    drawn += [line(wheel_x, wheel_y, *tip, GREEN, 1.5, "4 4"), arc(wheel_x, wheel_y, 82, 0, turn, GREEN)]
    drawn += [text(wheel_x + 100, wheel_y - 16, "steer", GREEN, "start")]
    drawn += [arrow(x - 4, y + 118, x - 105, y + 118, GREY, 1), arrow(x + 4, y + 118, x + 105, y + 118, GREY, 1)]
    drawn += [text(x - 52, y + 137, "rear_axle_to_cg", GREY, size=12)]
    drawn += [text(x + 52, y + 137, "front_axle_to_cg", GREY, size=12)]
    drawn += [text(20, 30, "from above: left is positive", anchor="start")]
    return page(
        660,
        350,
        *drawn,
        title="The car's axes from above: x forward, y left; steer, sideslip and yaw rate are positive to the left",
    )


def grade_and_bank() -> str:
    """From the side: uphill is a positive grade. From behind: a left side that is higher is a positive bank."""
    return page(
        660,
        260,
        *_from_the_side(),
        *_from_behind(),
        title="Grade is positive uphill, bank is positive with the left side up",
    )


def _from_the_side() -> list[str]:
    angle, x, y = 10, 165, 150
    rise = math.radians(angle)
    drawn = [line(20, 205, 310, 205, GREY, 1, "4 4"), line(20, 205, 310, 205 - 290 * math.tan(rise))]
    drawn += [box(x, y, 150, 38, angle, PALE, round_by=10)]
    for along in (-48, 48):
        drawn.append(
            circle(
                x + along * math.cos(rise) + 24 * math.sin(rise),
                y - along * math.sin(rise) + 24 * math.cos(rise),
                16,
                "#fff",
            )
        )
    drawn += [arrow(x, y, x + 130 * math.cos(rise), y - 130 * math.sin(rise)), symbol(x + 140, y - 22, "x")]
    drawn += [arrow(x, y, x - 90 * math.sin(rise), y - 90 * math.cos(rise)), symbol(x - 18, y - 96, "z")]
    drawn += [arc(20, 205, 230, 0, angle, GREEN), text(262, 188, "grade", GREEN, "start")]
    return [*drawn, text(20, 30, "from the side", anchor="start")]


def _from_behind() -> list[str]:
    angle, x, y = -9, 500, 140
    tilt = math.radians(angle)
    drawn = [line(360, 205, 640, 205, GREY, 1, "4 4"), line(360, 205 - 280 * math.tan(-tilt), 640, 205)]
    drawn += [box(x, y - 4, 110, 62, angle, PALE, round_by=12)]
    for across in (-44, 44):
        drawn.append(
            box(
                x + across * math.cos(tilt) - 38 * math.sin(-tilt) * -1,
                y - across * math.sin(tilt) + 34,
                16,
                36,
                angle,
                "#fff",
            )
        )
    drawn += [arrow(x, y, x - 110 * math.cos(tilt), y + 110 * math.sin(tilt)), symbol(x - 122, y - 18, "y")]
    drawn += [arrow(x, y, x - 90 * math.sin(tilt), y - 90 * math.cos(tilt)), symbol(x + 20, y - 92, "z")]
    drawn += [arc(640, 205, 210, 180, 180 + angle, RED), text(424, 198, "bank", RED, "end")]
    return [*drawn, text(360, 30, "from behind", anchor="start")]


def tyre() -> str:
    """A wheel from above: a positive slip angle gives a positive lateral force."""
    x, y, slip = 200, 150, 20
    move = math.radians(slip)
    drawn = [box(x, y, 150, 46, fill=PALE), line(x - 110, y, x + 150, y, GREY, 1, "4 4"), circle(x, y, 4, INK)]
    drawn += [arrow(x, y, x + 170 * math.cos(move), y + 170 * math.sin(move), BLUE, 2.5)]
    drawn += [
        text(x + 180 * math.cos(move), y + 182 * math.sin(move) + 8, "velocity of the wheel's middle", BLUE, size=13)
    ]
    drawn += [arc(x, y, 125, -slip, 0, GREEN), symbol(x + 133, y + 28, "α", GREEN, "start")]
    drawn += [arrow(x - 14, y, x - 14, y - 105, RED, 2.5), symbol(x - 14, y - 112, "F_y", RED)]
    drawn += [arrow(x, y, x + 105, y, RED, 2.5), symbol(x + 96, y - 10, "F_x", RED)]
    drawn += [text(20, y + 104, "F_y acts behind the middle, by the pneumatic trail", GREY, "start", size=12)]
    return page(
        480,
        270,
        *drawn,
        text(20, 30, "a wheel from above", anchor="start"),
        title="A wheel that moves to its right has a positive slip angle and a force to the left",
    )
