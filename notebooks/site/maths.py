"""Equations as MathML, which browsers draw without a script, a font or a network.

In a page `$...$` is an inline equation and `$$...$$` a displayed one; code is left unchanged.
"""

from __future__ import annotations

import re

CODE = re.compile(r"(^```.*?^```[ ]*$|`[^`\n]+`)", re.S | re.M)
DISPLAYED = re.compile(r"\$\$(.+?)\$\$", re.S)
INLINE = re.compile(r"(?<![\\$\w])\$(?!\s)([^$\n]+?)(?<!\s)\$(?![\w$])")


def draw_equations(text: str) -> str:
    """The page with its equations as MathML."""
    parts = CODE.split(text)
    return "".join(part if place % 2 else _draw(part) for place, part in enumerate(parts))


def _draw(text: str) -> str:
    text = DISPLAYED.sub(lambda found: f'\n\n<div class="equation">{_mathml(found[1], "block")}</div>\n\n', text)
    return INLINE.sub(lambda found: _mathml(found[1], "inline"), text)


def _mathml(formula: str, display: str) -> str:
    from latex2mathml.converter import convert

    return convert(" ".join(formula.split()), display=display).replace("\n", " ")
