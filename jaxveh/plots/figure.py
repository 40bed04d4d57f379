"""A matplotlib figure that notebooks show by themselves."""

from __future__ import annotations

import io as streams
from typing import TYPE_CHECKING

from jaxveh.io import kit

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Base
else:
    # Whoever imports the room without matplotlib is told which extra has it.
    Base = kit.require("matplotlib.figure", "drawing figures", "plot").Figure


class Figure(Base):
    """A figure made without pyplot: nothing global holds it, and a notebook shows it as a picture."""

    def _repr_png_(self) -> bytes:
        from jaxveh.plots.style import style

        content = streams.BytesIO()
        with style():
            self.savefig(content, format="png")
        return content.getvalue()
