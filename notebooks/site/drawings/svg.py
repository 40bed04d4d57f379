"""The shapes of the drawings: strings of SVG, x to the right and y down, in pixels."""

from __future__ import annotations

import math
from html import escape

INK, BLUE, RED, GREEN, GREY, PALE = "#1f2933", "#1b6ca8", "#c8553d", "#3a7d44", "#8794a1", "#e4e9ee"


def page(width: float, height: float, *shapes: str, title: str) -> str:
    """A drawing on a white background, so that it is readable on a dark page, too."""
    arrow = "".join(
        f'<marker id="head{colour[1:]}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="6.5" markerHeight="6.5" '
        f'orient="auto-start-reverse"><path d="M0 0L10 5L0 10z" fill="{colour}"/></marker>'
        for colour in (INK, BLUE, RED, GREEN, GREY)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" '
        f'font-family="system-ui, sans-serif" font-size="15"><title>{escape(title)}</title><defs>{arrow}</defs>'
        f'<rect width="{width}" height="{height}" rx="6" fill="#fff"/>{"".join(shapes)}</svg>\n'
    )


def line(x1, y1, x2, y2, colour=INK, width=1.5, dash="") -> str:
    """A straight line."""
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}" stroke-width="{width}"{dashes}/>'


def arrow(x1, y1, x2, y2, colour=INK, width=2.0) -> str:
    """A line with an arrowhead at its end."""
    return line(x1, y1, x2, y2, colour, width).replace("/>", f' marker-end="url(#head{colour[1:]})"/>')


def arc(x, y, radius, start, end, colour=INK, width=2.0, head=True) -> str:
    """An arc about (x, y), from angle to angle (degrees counter-clockwise from the right), with an arrowhead at its end."""
    x1, y1 = x + radius * math.cos(math.radians(start)), y - radius * math.sin(math.radians(start))
    x2, y2 = x + radius * math.cos(math.radians(end)), y - radius * math.sin(math.radians(end))
    large, sweep = int(abs(end - start) > 180), int(end < start)
    mark = f' marker-end="url(#head{colour[1:]})"' if head else ""
    return (
        f'<path d="M{x1:.1f} {y1:.1f}A{radius} {radius} 0 {large} {sweep} {x2:.1f} {y2:.1f}" fill="none" '
        f'stroke="{colour}" stroke-width="{width}"{mark}/>'
    )


def box(x, y, width, height, angle=0.0, fill="none", colour=INK, round_by=3.0) -> str:
    """A rectangle about its centre, rotated counter-clockwise by degrees."""
    return (
        f'<rect x="{x - width / 2:.1f}" y="{y - height / 2:.1f}" width="{width}" height="{height}" rx="{round_by}" fill="{fill}" '
        f'stroke="{colour}" stroke-width="1.5" transform="rotate({-angle} {x:.1f} {y:.1f})"/>'
    )


def circle(x, y, radius, fill="none", colour=INK) -> str:
    """A circle about (x, y)."""
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{fill}" stroke="{colour}" stroke-width="1.5"/>'


def curve(points, colour=INK, width=2.0) -> str:
    """A line through points."""
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def text(x, y, words, colour=INK, anchor="middle", size=15) -> str:
    """A text."""
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" text-anchor="{anchor}" font-size="{size}">{escape(words)}</text>'


def symbol(x, y, words, colour=INK, anchor="middle") -> str:
    """A symbol of an equation; the part after `_` is a subscript."""
    head, _, below = words.partition("_")
    index = f'<tspan dy="4" font-size="12">{escape(below)}</tspan>' if below else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" text-anchor="{anchor}" font-size="17" font-style="italic">'
        f"{escape(head)}{index}</text>"
    )
