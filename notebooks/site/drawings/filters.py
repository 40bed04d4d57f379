"""A filter's step: the belief is predicted, then updated; as a Gaussian and as particles."""

from __future__ import annotations

import math

from notebooks.site.drawings.svg import BLUE, GREEN, GREY, INK, PALE, RED, arrow, box, circle, curve, line, page, text


def _bell(x: float, y: float, width: float, high: float, colour: str) -> str:
    """A Gaussian about x on the line y."""
    points = [(x + width * k / 12, y - high * math.exp(-0.5 * (k / 12) ** 2)) for k in range(-36, 37)]
    return curve(points, colour, 2.2)


def gaussian_step() -> str:
    """Prior, prediction and posterior of a row."""
    ground = 180
    drawn = [line(20, ground, 700, ground, GREY, 1)]
    drawn += [_bell(110, ground, 22, 95, GREY), text(110, ground + 24, "belief of the last row", GREY, size=13)]
    drawn += [
        arrow(180, 120, 258, 120),
        text(219, 106, "predict", size=13),
        text(219, 144, "transition,", GREY, size=12),
    ]
    drawn += [text(219, 160, "process noise", GREY, size=12)]
    drawn += [_bell(350, ground, 40, 55, BLUE), text(350, ground + 24, "prediction", BLUE, size=13)]
    drawn += [_bell(400, ground, 26, 80, GREEN), text(425, 84, "measurement", GREEN, anchor="start", size=13)]
    drawn += [arrow(500, 120, 560, 120), text(530, 106, "update", size=13)]
    drawn += [_bell(632, ground, 19, 110, RED), text(632, ground + 24, "belief of this row", RED, size=13)]
    return page(
        720,
        225,
        *drawn,
        title="A Gaussian filter: the belief is predicted, which widens it, and updated by a measurement, which narrows it",
    )


def particle_step() -> str:
    """Particles are moved, weighted and resampled."""
    drawn: list[str] = []
    places = [(-60, 6), (-38, 7), (-20, 9), (-4, 7), (14, 8), (34, 6), (58, 7)]
    columns = (110, 300, 490, 660)
    names = ("particles", "moved", "weighed", "drawn anew")
    for x, name in zip(columns, names, strict=True):
        drawn.append(text(x, 210, name, size=13))
        drawn.append(line(x - 78, 185, x + 78, 185, GREY, 1))
    for place, (dx, dy) in enumerate(places):
        wide = dx * 1.15 + 6 * math.sin(5 * place)
        weight = math.exp(-0.5 * ((wide - 18) / 24) ** 2)
        drawn.append(circle(columns[0] + dx, 178 - dy * 5, 5, PALE, INK))
        drawn.append(circle(columns[1] + wide, 178 - dy * 6, 5, PALE, BLUE))
        drawn.append(circle(columns[2] + wide, 178 - dy * 6, round(2 + 8 * weight, 1), PALE, GREEN))
        drawn.append(circle(columns[3] + 18 + (place - 3) * 9, 178 - dy * 6, 5, PALE, RED))
    for begin, end, word in zip(
        columns, columns[1:], ("transition and noise", "likelihood", "resampling"), strict=False
    ):
        drawn += [arrow(begin + 66, 62, end - 66, 62), text((begin + end) / 2, 48, word, GREY, size=12)]
    return page(
        760,
        230,
        *drawn,
        title="A particle filter: particles are moved, weighted by the measurement's likelihood, and resampled",
    )


def rooms() -> str:
    """From a log to an answer: the modules of the package."""
    names = (
        ("io", "a log, a car's file"),
        ("estimators", "state space"),
        ("filters", "a scan"),
        ("Estimate", "mean, std, info"),
    )
    drawn: list[str] = []
    for place, (name, words) in enumerate(names):
        x = 95 + place * 185
        drawn += [box(x, 70, 140, 70, fill=PALE), text(x, 66, name), text(x, 88, words, GREY, size=12)]
        if place:
            drawn.append(arrow(x - 113, 70, x - 73, 70))
    return page(750, 140, *drawn, title="From a log to an answer: io, estimators, filters, an estimate")
