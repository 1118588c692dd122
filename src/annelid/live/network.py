"""The diagram of a worm's network for the panel: drawn once, its neurons then coloured by their potentials."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.config import RunConfig
from annelid.nervous import Network
from annelid.simulation.stepping import build_controller
from annelid.simulation.worm import WormPlant

FULL_MV = 20.0
"""Potential above or below rest at which a colour is full."""
BELOW, AT_REST, ABOVE = (0.48, 0.62, 0.95), (1.0, 1.0, 1.0), (0.96, 0.58, 0.25)


def network_of(config: RunConfig, neurons: Sequence[str]) -> Network | None:
    """Returns the network of these neurons that the controller of a configuration steps, or None without one."""
    with _compiled() as networks:
        build_controller(config, WormPlant(config))
    return next((network for network in networks if tuple(network.neurons) == tuple(neurons)), None)


def network_html(network: Network) -> str:
    """Returns the diagram of `annelid.nervous.Network.diagram`, with a class for every neuron."""
    svg = network.diagram().svg
    for number, name in enumerate(network.neurons):
        svg = svg.replace(f'id="{escape(f"neuron-{name}")}"', f'class="annelid-n{number}"', 1)
    key = f"blue {FULL_MV:g} mV below rest, white at rest, orange {FULL_MV:g} mV above"
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


@contextmanager
def _compiled() -> Iterator[list[Network]]:
    """Gives a list of all networks that are compiled meanwhile: a controller keeps only what it has compiled."""
    networks: list[Network] = []
    compile_network = Network.compile

    def noted(network: Network, *arguments: Any, **options: Any) -> Any:
        networks.append(network)
        return compile_network(network, *arguments, **options)

    Network.compile = noted  # type: ignore[method-assign]
    try:
        yield networks
    finally:
        Network.compile = compile_network  # type: ignore[method-assign]
