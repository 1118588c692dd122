"""The diagram of a worm's network for the panel: drawn once, its neurons then coloured by their potentials."""

from __future__ import annotations

from html import escape

import numpy as np
from numpy.typing import ArrayLike

from annelid.draw.figures.network_diagram import meanings_of, network_svg
from annelid.nervous import Network
from annelid.text import printable

FULL_MV = 20.0
"""Potential above or below rest at which a colour is full."""
BELOW, AT_REST, ABOVE = (0.48, 0.62, 0.95), (1.0, 1.0, 1.0), (0.96, 0.58, 0.25)


def network_html(network: Network) -> str:
    """Returns the drawing of a network and what its colours and labels mean."""
    colors = f"blue {FULL_MV:g} mV below rest, white at rest, orange {FULL_MV:g} mV above"
    meanings = (f"{label}: {role}" for label, role in meanings_of(network).items())
    key = escape(printable("; ".join([colors, *meanings])))
    drawing = network_svg(network)
    return f'<div class="annelid-network">{drawing}<p style="font-size:0.8em;margin:0.3em 0.6em">{key}</p></div>'


def colors_html(potential_mV: ArrayLike) -> str:
    """Returns a style sheet that colours the neurons of `network_html`, of numbers only."""
    share = np.clip(np.nan_to_num(np.asarray(potential_mV, dtype=float)) / FULL_MV, -1.0, 1.0)[:, np.newaxis]
    rest, ends = np.asarray(AT_REST), np.where(share < 0, BELOW, ABOVE)
    colors = np.rint(255 * (rest + np.abs(share) * (ends - rest))).astype(int)
    rule = "#neuron-{0} path{{fill:rgb({1} {2} {3})!important}}"
    return f"<style>{''.join(rule.format(i, *color) for i, color in enumerate(colors.tolist()))}</style>"
