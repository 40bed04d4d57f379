"""The cars' degrees of freedom: the motions of each fidelity."""

from __future__ import annotations

from notebooks.site.drawings.svg import BLUE, GREEN, GREY, PALE, RED, arc, arrow, box, circle, line, page, symbol, text

WIDE, HIGH = 220, 210


def _cell(column: int, row: int, name: str, states: str) -> tuple[float, float, list[str]]:
    x, y = 20 + column * WIDE + WIDE / 2, 30 + row * HIGH + 95
    return x, y, [text(x, y - 82, name, size=14), text(x, y + 92, states, GREY, size=12)]


def _single_track(x: float, y: float) -> list[str]:
    return [
        line(x - 60, y, x + 60, y),
        box(x - 60, y, 36, 12, fill="#fff"),
        box(x + 60, y, 36, 12, 20, fill="#fff"),
        circle(x, y, 4, "#1f2933"),
    ]


def _four_wheels(x: float, y: float, spin: bool = False) -> list[str]:
    places = [(x - 52, y - 34, 0), (x - 52, y + 34, 0), (x + 52, y - 34, 18), (x + 52, y + 34, 18)]
    drawn = [box(x, y, 140, 60, fill=PALE, round_by=10), *(box(*p[:2], 32, 11, p[2], fill="#fff") for p in places)]
    if spin:
        drawn += [arc(p[0], p[1] + (-14 if p[1] < y else 14), 11, 160, 20, GREEN, 1.6) for p in places]
    return [*drawn, circle(x, y, 4, "#1f2933")]


def _moves(x: float, y: float, forward: bool) -> list[str]:
    """The motions in the plane: lateral, yaw, and forward if the speed is a state."""
    drawn = [arrow(x, y, x, y - 52, BLUE), symbol(x + 14, y - 46, "v_y", BLUE), arc(x, y, 26, 210, 330, RED)]
    return [*drawn, *([arrow(x, y, x + 92, y, BLUE), symbol(x + 92, y - 10, "v_x", BLUE)] if forward else [])]


def _from_behind(x: float, y: float, unsprung: bool) -> list[str]:
    """A body that rolls; optionally with wheels that move up and down independently."""
    drawn = [
        box(x, y - 14, 96, 56, -6, PALE, round_by=10),
        arc(x, y - 6, 46, 120, 60, RED),
        text(x, y - 60, "roll", RED),
    ]
    for side in (-1, 1):
        drawn.append(box(x + side * 56, y + 40, 14, 36, fill="#fff"))
        drawn.append(line(x + side * 40, y + 14, x + side * 54, y + 26, GREY, 2, "3 2"))
        if unsprung:
            drawn.append(arrow(x + side * 78, y + 52, x + side * 78, y + 22, BLUE))
    return drawn


def fidelities() -> str:
    """From the single track to fourteen degrees of freedom."""
    drawn: list[str] = []
    for place, (name, states, body) in enumerate(
        (
            ("SingleTrack", "v_y, yaw_rate; v_x is given", lambda x, y: [*_single_track(x, y), *_moves(x, y, False)]),
            ("SingleTrack3DOF", "and v_x", lambda x, y: [*_single_track(x, y), *_moves(x, y, True)]),
            ("TwoTrack3DOF", "v_x, v_y, yaw_rate; four loads", lambda x, y: [*_four_wheels(x, y), *_moves(x, y, True)]),
            ("Roll4DOF", "and roll", lambda x, y: _from_behind(x, y, False)),
            ("SevenDOF", "and four spins, without roll", lambda x, y: [*_four_wheels(x, y, True), *_moves(x, y, True)]),
            (
                "FourteenDOF",
                "six of the body, eight of the wheels",
                lambda x, y: [*_from_behind(x, y, True), arrow(x, y - 14, x, y - 44, BLUE)],
            ),
        )
    ):
        x, y, words = _cell(place % 3, place // 3, name, states)
        drawn += [*words, *body(x, y)]
    return page(
        3 * WIDE + 40,
        2 * HIGH + 40,
        *drawn,
        title="Degrees of freedom: single track, two tracks, roll, spinning wheels, fourteen",
    )
