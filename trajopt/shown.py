"""How results show themselves: as a picture, and in a notebook."""

from __future__ import annotations

from typing import Any


class Shown:
    """What has a picture and facts in ``report.shown``, which is loaded when asked for."""

    def plot(self) -> Any:
        """The picture of it, a matplotlib Figure; ``figure.savefig("a.pdf")`` saves it as PDF, SVG
        or PNG."""
        from trajopt.report.shown import figure_of

        return figure_of(self)

    def _repr_html_(self) -> str:
        from trajopt.report.shown import html

        return html(self)
