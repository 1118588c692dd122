"""A worm to look at in a browser while it runs, or as it was recorded; to change and to poke."""

from __future__ import annotations

from typing import TYPE_CHECKING

from annelid.lazy import lazy

if TYPE_CHECKING:
    from annelid.live.panel import Curve, Plot
    from annelid.live.show import Show

__all__ = ["Curve", "Plot", "Show"]
__getattr__, __dir__ = lazy(__name__)
