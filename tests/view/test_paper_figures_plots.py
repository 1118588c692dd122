"""The paper's figures 1, 5, 6 and 9: what is drawn is what the plant, the engine and the network say."""

from __future__ import annotations

import re
from collections import Counter
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import imageio.v3
import numpy as np
import pytest

import annelid
from annelid.body import Rings
from annelid.body.worm import WormBody
from annelid.config import load_config
from annelid.draw.figures.network_diagram import (
    by_segment,
    effect_of,
    labels_of,
    meanings_of,
    network_figure,
    place_neurons,
    route_connections,
)
from annelid.nervous import Network
from annelid.nervous.neurons import GapJunction, Neuron, Synapse, persistent_sodium
from annelid.nervous.peristalsis import peristalsis_network
from annelid.nervous.robust import robust_network
from annelid.simulation.runfile import Run
from annelid_studies.riddle2023.figures import muscle_surface, robot_lengths


def assert_two_good_files(png: Path) -> None:
    assert png.suffix == ".png"
    ElementTree.parse(png.with_suffix(".svg"))
    pixels = imageio.v3.imread(png)[:, :, :3]
    white = np.all(pixels == 255, axis=2)
    assert white.shape[1] > 1000
    assert 0.3 < white.mean() < 0.97
    # Nothing is cut off at the edges.
    assert white[[0, -1]].all()
    assert white[:, [0, -1]].all()


# Figure 5


@pytest.fixture(scope="module")
def rings() -> Rings:
    body = load_config("riddle2023").body
    assert isinstance(body, WormBody)
    return body.muscles


def test_scaled_lengths_are_the_engines(rings: Rings) -> None:
    import mujoco

    low, high = rings.length_ranges(3)[0]
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco><worldbody><site name="a"/><body pos="1 0 0"><joint type="slide" axis="1 0 0"/>
        <geom size=".1"/><site name="b"/></body></worldbody>
        <tendon><spatial name="t"><site site="a"/><site site="b"/></spatial></tendon>
        <actuator><muscle tendon="t" force="7" lengthrange="{low} {high}" lmin="{rings.minimum_length}"/></actuator>
        </mujoco>""")
    data = mujoco.MjData(model)
    for length, speed in ((0.4, 0.0), (0.7, -0.3), (1.2, 0.2)):
        data.qpos[:], data.qvel[:], data.act[:] = length - 1.0, speed, 1.0
        mujoco.mj_forward(model, data)
        optimal = (high - low) / 0.3
        scaled = muscle_surface.scaled_length(length, (low, high))
        expected = 7.0 * muscle_surface.engine_flv(scaled, speed / optimal, rings)
        assert -data.actuator_force[0] == pytest.approx(float(expected), abs=1e-9)


def test_figure_5_and_its_caption(rings: Rings, tmp_path: Path) -> None:
    text = muscle_surface.figure_5_muscle_surface(rings, tmp_path / "figure_5")
    assert_two_good_files(tmp_path / "figure_5.png")
    assert muscle_surface.largest_difference(rings) < 1e-9
    assert "1.57 to 1.77 m" in text
    # Where rings contracted against about 2.5 N come to rest in the paper's worm: 0.33-0.43 of 0.96 m.
    assert "0.32 to 0.41 m" in text


# Figure 6


def own_network() -> Network:
    """Everything a network can have: synapses, gap junctions, twins, a self-connection, a shifted rest."""
    network = Network("own")
    sodium = Neuron(channels=(persistent_sodium(1.0),))
    for name, neuron in {
        "motor": Neuron(rest_mV=-60.0),
        "left": sodium,
        "right": sodium,
        "command": Neuron(),
        "sensor": Neuron(),
    }.items():
        network.add_neuron(name, neuron)
    network.add_synapse("left", "right", Synapse(1.0, -40.0))
    network.add_synapse("right", "left", Synapse(1.0, -40.0))
    network.add_synapse("left", "motor", Synapse(1.0, -20.0))
    network.add_synapse("sensor", "command", Synapse(0.3, 194.0))
    network.add_synapse("sensor", "command", Synapse(0.2, -40.0))
    network.add_synapse("sensor", "sensor", Synapse(0.2, 100.0))
    network.add_synapse("command", "right", Synapse(0.4, 60.0))
    network.add_gap_junction("command", "left", GapJunction(0.5))
    network.add_gap_junction("command", "motor", GapJunction(0.5, rectified=True))
    network.add_input("touch", ("sensor", "command"))
    network.add_output("drive", "motor")
    return network


NETWORKS = (peristalsis_network(3), own_network(), robust_network(3))


def test_every_part_of_a_network_is_drawn_exactly_once_and_connections_avoid_other_neurons(tmp_path: Path) -> None:
    for network in NETWORKS:
        svg = ElementTree.parse(network_figure(network, tmp_path / "network.svg"))
        ids = Counter(
            node.get("id", "") for node in svg.iter() if node.get("id", "").startswith(("neuron-", "connection-"))
        )
        expected = [f"neuron-{i}" for i in range(len(network.neurons))]
        assert ids == Counter([*expected, *(f"connection-{i}" for i in range(len(network.connections)))])
        places = place_neurons(network)
        assert min(abs(one - other) for one, other in combinations(places.values(), 2)) >= 0.999
        for link, route in zip(network.connections, route_connections(network, places), strict=True):
            assert abs(route[[0, -1]] - [places[link.source], places[link.target]]) == pytest.approx(0.27, abs=0.03)
            others = [place for name, place in places.items() if name not in (link.source, link.target)]
            assert all(abs(route - place).min() > 0.28 for place in others)


def test_a_neuron_has_one_colour_in_the_network_of_a_run_and_in_its_trace(planar_run: Run, tmp_path: Path) -> None:
    path = tmp_path / "network.svg"
    annelid.plot(planar_run, path, figure="network")
    colors = {
        node.get("id", ""): re.findall("stroke: (#[0-9a-f]{6})", ElementTree.tostring(node, encoding="unicode"))
        for node in ElementTree.parse(path).iter()
        if node.get("id", "").startswith(("neuron-", "trace-"))
    }
    n = planar_run.data.sizes["neuron"]
    assert set(colors) == {f"{what}-{i}" for what in ("neuron", "trace") for i in range(n)}
    assert all(colors[f"neuron-{i}"] == colors[f"trace-{i}"] for i in range(n))
    assert len({*map(tuple, colors.values())}) == 4, "contraction, expansion, sensory and relay"


def test_segments_are_columns_from_left_to_right_and_other_neurons_stand_below() -> None:
    network = robust_network(12)
    places = place_neurons(network)
    segments, others = by_segment(network.neurons)
    x = np.array([[places[name].real for name in names] for names in segments.values()])
    assert np.all(x[:-1].max(axis=1) < x[1:].min(axis=1))
    assert others == ["tonic"]
    assert places["tonic"].imag < min(places[name].imag for names in segments.values() for name in names)


def test_effects_come_from_reversal_and_rest() -> None:
    network = own_network()
    effects = [effect_of(network, link) for link in network.connections]
    assert effects[:3] == ["inhibitory", "inhibitory", "excitatory"]
    assert effects[-2:] == ["gap junction", "rectified gap junction"]


def test_long_names_are_shortened_and_explained() -> None:
    network = Network()
    for name in ("left", "half_centre_1", "half_centre_2"):
        network.add_neuron(name, Neuron())
    assert labels_of(network) == {"left": "left", "half_centre_1": "hal", "half_centre_2": "hal"}
    assert meanings_of(network) == {"hal": "half_centre"}


# Figure 9


def test_figure_9_shows_robot_model_and_every_series(tmp_path: Path) -> None:
    series = {"first helix": (0.0403, 0.0255, 0.0429), "mean of six": (0.0330, 0.0252, 0.0345)}
    caption = robot_lengths.figure_9_robot_lengths(series, tmp_path / "figure_9")
    assert_two_good_files(tmp_path / "figure_9.png")
    svg = (tmp_path / "figure_9.svg").read_text(encoding="utf-8")
    for number in ("6.15", "3.82", "4.78", "5.98", "4.20", "2.55", "4.02", "4.03", "4.29", "3.30", "0.62", "0.76"):
        assert f"<!-- {number} -->" in svg
    assert "numbers are given of these maxima only" in caption
