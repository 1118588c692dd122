"""The diagram of a worm's network for the panel: drawn once, its neurons then coloured by their potentials."""

from __future__ import annotations

from html import escape

import numpy as np
from numpy.typing import ArrayLike

from annelid.nervous import Network
from annelid.nervous.drawing import meanings_of

FULL_MV = 20.0
"""Potential above or below rest at which a colour is full."""
BELOW, AT_REST, ABOVE = (0.48, 0.62, 0.95), (1.0, 1.0, 1.0), (0.96, 0.58, 0.25)


def network_html(network: Network) -> str:
    """Returns the diagram of `annelid.nervous.Network.diagram`, with a class for every neuron."""
    svg = network.diagram(details=False).svg
    for number, name in enumerate(network.neurons):
        svg = svg.replace(f'id="{escape(f"neuron-{name}")}"', f'class="annelid-n{number}"', 1)
    colors = f"blue {FULL_MV:g} mV below rest, white at rest, orange {FULL_MV:g} mV above"
    key = escape("; ".join([colors, *meanings_of(network)]))
    return f'<div class="annelid-network">{svg}<p style="font-size:0.8em;margin:0.3em 0.6em">{key}</p></div>'


def colors_html(potential_mV: ArrayLike) -> str:
    """Returns a style sheet that colours the neurons of `network_html`, of numbers only."""
    share = np.clip(np.nan_to_num(np.asarray(potential_mV, dtype=float)) / FULL_MV, -1.0, 1.0)[:, np.newaxis]
    rest, ends = np.asarray(AT_REST), np.where(share < 0, BELOW, ABOVE)
    colors = np.rint(255 * (rest + np.abs(share) * (ends - rest))).astype(int)
    # A second rim, inside the first, would cover it.
    rule = ".annelid-n{0}{{fill:rgb({1} {2} {3})}}.annelid-n{0}+polygon{{fill:none}}"
    rules = (rule.format(number, *color) for number, color in enumerate(colors.tolist()))
    return f"<style>{''.join(rules)}</style>"
