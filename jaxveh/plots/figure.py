"""A matplotlib figure that notebooks show by themselves."""

from __future__ import annotations

import io as streams

import matplotlib.figure


class Figure(matplotlib.figure.Figure):
    """A figure made without pyplot: nothing global holds it, and a notebook shows it as a picture."""

    def _repr_png_(self) -> bytes:
        from jaxveh.plots.style import style

        content = streams.BytesIO()
        with style():
            self.savefig(content, format="png")
        return content.getvalue()
