"""A figure that notebooks show, also where pyplot was never imported."""

from __future__ import annotations

import io

from matplotlib.figure import Figure


class Picture(Figure):
    """A figure of matplotlib that belongs to no window."""

    def _repr_png_(self) -> bytes:
        """Draws it for a notebook."""
        drawn = io.BytesIO()
        self.savefig(drawn, format="png")
        return drawn.getvalue()
