"""A matplotlib figure that notebooks show automatically."""

from __future__ import annotations

import io as streams
from typing import TYPE_CHECKING

from jaxveh.io import kit

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Base
else:
    # An import of the subpackage without matplotlib raises an error that names the extra.
    Base = kit.require("matplotlib.figure", "drawing figures", "plot").Figure


class Figure(Base):
    """A figure made without pyplot: it is not part of any global state, and a notebook shows it as a picture."""

    def _repr_png_(self) -> bytes:
        from jaxveh.plots.style import style

        content = streams.BytesIO()
        with style():
            self.savefig(content, format="png")
        return content.getvalue()
