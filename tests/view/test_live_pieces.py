"""The live view without a browser: what is drawn, what is remembered, what is shown when, what can be turned."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.config import load_config, preset_names
from annelid.draw.strands import POINTS_PER_SIDE
from annelid.errors import ConfigError, RunFileError
from annelid.live.history import History, Moment, history_of
from annelid.live.lines_and_arrows import Painter
from annelid.live.live_worm import LiveWorm, knobs_of
from annelid.live.panel import MOST_SAMPLES, plots_of
from annelid.live.player import Player, player_of
from annelid.live.requests import Requests
from annelid.live.scene_geoms import triangles
from annelid.simulation.runfile import Run
from annelid.simulation.worm import compile_worm
from annelid_lab.logs import LogMap, read_measured
from annelid_lab.logs.agreement import compare_with_log, run_series
from annelid_lab.logs.report import measured_plots

FRAME_S = 0.04
ROBOT = Path(__file__).parents[2] / "examples" / "robot" / "robot.xml"


def history(n: int) -> History:
    """Moments every 40 ms whose posture is their number."""
    made = History(["contraction_1", "activation_1"])
    for i in range(n):
        made.add(Moment(i * FRAME_S, np.full(3, i), np.zeros(1), np.zeros((1, 3))))
        made.add_sample(i * FRAME_S, np.array([i, -i], dtype=float))
    return made


def moment(qpos: np.ndarray, n_segments: int, force: np.ndarray | None = None) -> Moment:
    still = np.zeros((n_segments, 3)) if force is None else force
    return Moment(0.0, qpos, np.linspace(0, 1, n_segments), still)


def test_a_refusal_is_shown_until_something_is_requested_again() -> None:
    def refuse() -> None:
        raise ConfigError("that cannot be")

    requests, met = Requests(), []
    requests.add(refuse)
    requests.add(met.append, 1)
    requests.meet()
    assert (requests.notice, met) == ("that cannot be", [1])
    requests.meet()
    assert requests.notice == "that cannot be"
    requests.add(met.append, 2)
    requests.meet()
    assert (requests.notice, met) == ("", [1, 2])


def test_a_picture_has_every_part() -> None:
    config = load_config("riddle2023-rods")
    anatomy = compile_worm(config)
    painter = Painter(anatomy, config)
    lift = np.zeros((3, 3))
    lift[1, 2] = painter.arrow_N
    picture = painter.paint(moment(anatomy.model.qpos0, 3, lift))
    pieces = POINTS_PER_SIDE * (len(anatomy.geometry.crossing_vertex) + 1)
    assert picture.strands.shape == (anatomy.geometry.n_strands * pieces, 2, 3) == painter.strand_colors().shape
    assert picture.springs.shape == (len(anatomy.geometry.springs), 2, 3) == picture.spring_colors.shape
    assert picture.rings.shape == picture.ring_colors.shape
    arrows = picture.contacts[:, 1] - picture.contacts[:, 0]
    np.testing.assert_allclose(arrows, [[0, 0, 0], [0, 0, anatomy.geometry.radius_m], [0, 0, 0]], atol=1e-6)
    ring = anatomy.geometry.crossings_m[anatomy.geometry.rings[1]]
    assert picture.contacts[1, 0, 2] == pytest.approx(ring[:, 2].min())


@given(time=st.floats(-1.0, 5.0))
def test_the_moment_shown_is_the_last_one_before(time: float) -> None:
    shown = history(50).at(time).time_s
    assert shown == 0.0 if time < 0 else shown <= time + 1e-9 < shown + FRAME_S + 1e-8 or shown == 49 * FRAME_S


@given(first=st.floats(0, 2), length=st.floats(0, 2), most=st.integers(2, 60))
def test_a_window_of_signals_is_thinned_evenly(first: float, length: float, most: int) -> None:
    times, values = history(50).window(first, first + length, most)
    assert len(times) <= most + 1
    assert ((times >= first) & (times <= first + length + 1e-6)).all()
    np.testing.assert_allclose(values[:, 0] * FRAME_S, times)
    assert len(set(np.diff(times).round(9))) <= 1


def test_the_oldest_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("annelid.live.history.MOST_MOMENTS", 500)
    grown = history(2000)
    first, last = grown.span_s
    assert last == pytest.approx(1999 * FRAME_S)
    assert 500 * FRAME_S <= last - first <= 1500 * FRAME_S
    assert grown.window(0.0, last, 10_000)[0][0] >= first


@given(ticks=st.lists(st.floats(0.0, 0.2), max_size=30), speed=st.floats(0.1, 10))
def test_a_run_plays_at_its_speed_and_stops_at_its_end(ticks: list[float], speed: float) -> None:
    player = Player(history(50), speed)
    for elapsed in ticks:
        player.tick(elapsed)
    passed = speed * sum(ticks)
    end = 49 * FRAME_S
    frame = FRAME_S * math.floor(passed / FRAME_S + 1e-6)
    assert player.moment.time_s == pytest.approx(min(frame, end), abs=1.01 * FRAME_S)
    if passed > end + 1e-6:
        assert player.at_end
        assert player.moment.time_s == end


def test_pause_seek_play_and_restart() -> None:
    player = Player(history(50))
    player.tick(0.5)
    player.pause()
    player.tick(5.0)
    assert player.moment.time_s == pytest.approx(0.48)
    player.seek(1.0)
    assert (player.moment.time_s, player.playing) == (pytest.approx(1.0), False)
    player.play()
    player.tick(100.0)
    assert (player.at_end, player.playing) == (True, False)
    player.play()
    assert player.moment.time_s == 0.0


def test_a_living_worm_keeps_pace_and_can_be_looked_back_on() -> None:
    player, _ = player_of(load_config("riddle2023-rods", {"clock.physics_timestep_s": 0.02}), speed=2.0)
    for _ in range(15):
        player.tick(1 / 30)
    # Steps of 20 ms: never behind the clock by more than rounding, never ahead by more than a step.
    assert 1.0 - 1e-9 <= player.moment.time_s <= 1.02 + 1e-9
    present = player.moment
    player.seek(0.4)
    assert not player.at_end
    assert player.moment.time_s == pytest.approx(0.4, abs=0.08)
    player.play()
    player.tick(0.1)
    assert player.moment.time_s < present.time_s
    player.go_live()
    assert player.moment is present
    player.tick(0.05)
    assert player.moment.time_s > present.time_s
    player.restart()
    assert (player.moment.time_s, player.history.span_s) == (0.0, (0.0, 0.0))


def test_a_worm_that_blows_up_says_so_and_can_start_anew() -> None:
    player, _ = player_of(load_config("riddle2023-rods", {"guard.kinetic_energy_J": 1e-9}))
    player.tick(5.0)
    assert "kinetic energy" in player.stopped
    assert not player.playing
    seen = player.moment.time_s
    player.play()
    player.tick(1.0)
    assert player.moment.time_s == seen
    player.restart()
    assert (player.stopped, player.moment.time_s) == ("", 0.0)


def test_a_turned_knob_changes_the_model_and_a_bad_value_changes_nothing() -> None:
    worm = LiveWorm(load_config("riddle2023-rods"))
    worm.advance(0.1, math.inf)
    worm.adjust({"arena.friction": 0.25})
    model = worm.plant.model
    touching = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    assert set(model.geom_friction[touching, 0]) == {0.25}
    with pytest.raises(ConfigError, match="friction"):
        worm.adjust({"arena.friction": -1.0})
    assert worm.config.arena is not None
    assert worm.config.arena.friction == 0.25
    worm.reset_fields()
    assert set(model.geom_friction[touching, 0]) == {1.0}
    assert worm.time_s == pytest.approx(0.1)


def test_a_poke_pushes_and_ends() -> None:
    worm, left_alone = (LiveWorm(load_config("riddle2023-rods")) for _ in range(2))
    place = worm.plant.geometry.crossings_m[20]
    worm.poke(place, np.array([0.0, 3.0, 0.0]))
    for each in (worm, left_alone):
        each.advance(0.1, math.inf)
    shift = worm.simulation.sensation.center_of_mass_m - left_alone.simulation.sensation.center_of_mass_m
    assert shift[1] > 0.002
    worm.advance(0.5, math.inf)
    assert not worm.plant.data.xfrc_applied.any()


def test_every_knob_begins_inside_its_range_and_its_ends_are_allowed(subtests: pytest.Subtests) -> None:
    for config in filter(lambda one: one.body.kind == "worm", map(load_config, preset_names())):
        with subtests.test(config.name):
            knobs = knobs_of(config)
            assert {"arena.friction", "body.strands.young_modulus_Pa"} <= {knob.field for knob in knobs}
            for knob in knobs:
                assert knob.low < knob.high
                for shown in (knob.shown(config), knob.low, knob.high):
                    kept = load_config(config.model_dump(), {knob.field: knob.value(shown)})
                    assert knob.shown(kept) == pytest.approx(shown)


def test_plots_name_what_the_controller_has() -> None:
    names = [f"{role}_{i}" for i in (1, 2) for role in ("contraction", "expansion", "relay")]
    plots = plots_of([*names, "tonic", "activation_1", "activation_2"])
    assert list(plots) == [
        "half-centres",
        "neurons of segment 1",
        "neurons of segment 2",
        "other neurons",
        "activation",
    ]
    assert {curve.signal for curve in plots["neurons of segment 2"].curves} == set(names[3:])
    assert list(plots_of(["activation_1"])) == ["activation"]


def test_a_log_is_drawn_beside_the_run_that_it_was_aligned_with(planar_run: Run, tmp_path: Path) -> None:
    """A log of the run itself, in mm and begun later: both curves of its plot are one, at the run's times."""
    time_s, lengths_m, _ = run_series(planar_run, "stretch_length[1, mean]")
    begun = len(time_s) // 4
    table = np.column_stack([time_s[begun:] - time_s[begun], 1e3 * lengths_m[begun:]])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t_s,s1_mm", comments="")
    log_map = LogMap.model_validate({"time": "t_s", "map": {"s1_mm": "stretch_length[1, mean]"}})
    agreement = compare_with_log(planar_run, read_measured(tmp_path / "log.csv", log_map))
    (name, plot), *others = measured_plots(agreement).items()
    assert (name, others) == ("measured: s1_mm", [])
    assert [(curve.label, curve.dashed) for curve in plot.curves] == [("simulated", False), ("measured", True)]
    first, last = time_s[len(time_s) // 2], time_s[-1]
    times, simulated, measured = plot.window(first, last)
    assert first <= times[0] < times[-1] <= last
    assert len(times) <= MOST_SAMPLES
    assert np.abs(simulated - measured).max() < 1e-3 * np.ptp(lengths_m)
    assert np.abs(simulated - np.interp(times, time_s, lengths_m)).max() < 1e-3 * np.ptp(lengths_m)


def test_a_run_is_read_as_it_was_recorded(rods_run: Run) -> None:
    n = rods_run.data.sizes["coordinate"]
    recorded = history_of(rods_run, n)
    times = rods_run.data["frame_time"].values
    assert [recorded.at(time).time_s for time in times] == times.tolist()
    np.testing.assert_array_equal(recorded.at(0.12).qpos, rods_run.data["qpos"].sel(frame=3).values)
    _, values = recorded.window(0.0, 1.0, 1000)
    np.testing.assert_array_equal(values[:, :12], rods_run.data["potential"].values)
    with pytest.raises(RunFileError, match="another version"):
        history_of(rods_run, n + 1)


def test_the_ground_is_there_and_a_ray_is_turned_into_the_axes_of_a_slope() -> None:
    from annelid.live.scene_nodes import LAYERS, Stage
    from annelid.live.server import Server

    posts: dict[str, Any] = {"arena.posts": [[-0.4, 0.1, 0.1]], "arena.slope_deg": 30.0}
    for arena, overrides, nodes in (
        ("steps", {}, {"relief"}),
        ("pipe.bend", {}, {"pipe", "floor"}),
        ("rails", posts, {"floor", "rail_left", "rail_right", "post_0"}),
    ):
        config = load_config("riddle2023-rods", overrides, arena=arena)
        player, painter = player_of(config)
        server = Server()
        try:
            stage = Stage(server, config, painter, player.moment)
            names = {"floor", "rail_left", "rail_right", "post_0", "relief", "pipe"}
            assert {name for name in names if server.scene.get_handle_by_name(f"/worm/ground/{name}")} == nodes
            for layer in LAYERS:
                stage.set_visible(layer, False)
            player.tick(0.3)
            stage.show(player.moment)
        finally:
            server.stop()
    place, along = np.array([0.3, -0.1, 0.2]), np.array([0.0, 0.6, 0.8])
    origin, sight = stage.to_model(stage.turn @ place + stage.shift_m, stage.turn @ along)
    np.testing.assert_allclose([origin, sight], [place, along], atol=1e-12)
    # The worm leads towards -x, which is uphill.
    assert (stage.turn @ np.array([-1.0, 0.0, 0.0]))[2] == pytest.approx(0.5)


def test_a_planar_worm_is_seen_from_its_side(planar_run: Run) -> None:
    player, painter = player_of(planar_run)
    picture = painter.paint(player.history.at(0.0))
    assert picture.strands.shape == picture.ring_colors.shape == (3 * 4, 2, 3)
    ends = planar_run.data["stretch_length"].values[0, :, 0].sum() / 2
    np.testing.assert_allclose(picture.strands[..., 0].min(), -ends, atol=1e-6)
    assert not picture.strands[..., 1].any()
    living, _ = player_of(planar_run.config)
    living.tick(0.05)
    assert living.history.span_s[1] >= 0.05


def test_a_robot_of_ones_own_is_seen_while_it_runs() -> None:
    from annelid.live.scene_nodes import Stage
    from annelid.live.server import Server

    config = load_config(ROBOT, {"controller.kind": "timed"})
    player, painter = player_of(config)
    server = Server()
    try:
        stage = Stage(server, config, painter, player.moment)
        heads = server.scene.get_handle_by_name("/worm/ground/1")
        assert heads is not None
        first = np.array(heads.position)
        player.tick(1.0)
        stage.show(player.moment)
        assert np.abs(np.array(heads.position) - first).max() > 1e-3
    finally:
        server.stop()
    rings = painter.paint(player.moment)
    assert rings.rings.shape == rings.ring_colors.shape == (3, 2, 3)
    assert painter.arrow_N == pytest.approx(2 * 9.81 * 0.8 / 3, rel=0.1)


def test_names_of_neurons_stay_words_in_the_live_diagram() -> None:
    from annelid.live.network import colors_html, network_html
    from annelid.nervous import Network, Neuron

    network, name = Network("<b>x</b>"), '</style><img src=x onerror="alert(1)">_1'
    network.add_neuron(name, Neuron(capacitance_nF=5.0, leak_conductance_uS=1.0))
    html = network_html(network)
    assert "<img" not in html
    assert "<b>" not in html
    assert html.count('id="neuron-0"') == 1
    assert colors_html([-40.0]) == colors_html([-20.0]) != colors_html([0.0])
    assert "rgb(255 255 255)" in colors_html([float("nan")])


def test_the_live_diagram_is_of_the_network_that_is_stepped() -> None:
    from annelid.draw.figures.network_diagram import network_of
    from annelid.live.panel import neurons_of

    worm = LiveWorm(load_config("riddle2025-adaptive"))
    neurons = neurons_of(worm.history.names)
    network = network_of(worm.config, neurons)
    assert network is not None
    assert list(network.neurons) == neurons
    assert network_of(worm.config, ["another"]) is None


SHAPES = {
    "box": ('type="box" size="0.1 0.2 0.3"', 0.048),
    "sphere": ('type="sphere" size="0.1"', 4 / 3 * math.pi * 0.1**3),
    "ellipsoid": ('type="ellipsoid" size="0.1 0.2 0.3"', 4 / 3 * math.pi * 0.006),
    "cylinder": ('type="cylinder" size="0.1 0.2"', math.pi * 0.01 * 0.4),
    "capsule": ('type="capsule" size="0.1 0.2"', math.pi * 0.01 * 0.4 + 4 / 3 * math.pi * 0.1**3),
    "mesh": ('type="mesh" mesh="m"', 0.5 / 3),
}


def test_triangles_of_a_thing_enclose_its_volume_about_its_centre() -> None:
    import mujoco
    import trimesh

    for geom, volume in SHAPES.values():
        mesh = '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>'
        model = mujoco.MjModel.from_xml_string(f"<mujoco>{mesh}<worldbody><geom {geom}/></worldbody></mujoco>")
        made = trimesh.Trimesh(*triangles(model, 0), process=True)
        assert made.is_watertight
        assert made.volume == pytest.approx(volume, rel=0.03)
        assert made.center_mass == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)


def test_a_height_field_is_drawn_where_the_engine_has_it() -> None:
    import mujoco

    field = '<asset><hfield name="h" nrow="2" ncol="3" size="2 1 0.5 0.1" elevation="0 0 1 0 0 0"/></asset>'
    world = '<worldbody><geom type="hfield" hfield="h"/></worldbody>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{field}{world}</mujoco>")
    vertices, faces = triangles(model, 0)
    # The first row of the text is at the left, +y.
    assert vertices[vertices[:, 2].argmax()] == pytest.approx([2.0, 1.0, 0.5])
    first, second, third = vertices[faces[0]]
    assert np.cross(second - first, third - first)[2] > 0.0


def test_things_of_a_scene_are_placed_where_the_engine_has_them() -> None:
    config = load_config("riddle2023-rods", arena=Path(__file__).parents[2] / "examples" / "scene" / "scene.xml")
    anatomy = compile_worm(config)
    painter, qpos = Painter(anatomy, config), anatomy.model.qpos0.copy()
    box = anatomy.model.body("scene/box")
    first = int(anatomy.model.jnt_qposadr[box.jntadr[0]])
    qpos[first : first + 7] = [-1.0, 0.5, 0.3, 0.0, 1.0, 0.0, 0.0]
    painter.paint(moment(qpos, anatomy.n_segments))
    places, turns = painter.places(np.array([box.geomadr[0]]))
    assert places[0] == pytest.approx([-1.0, 0.5, 0.3])
    assert np.abs(turns[0]) == pytest.approx([0.0, 1.0, 0.0, 0.0])


def test_a_field_with_a_number_per_segment_has_no_slider() -> None:
    lists = {"body.strands.young_modulus_Pa": [3e8, 6e8, 3e8], "body.springs.stiffness_N_per_m": [20.0, 30.0, 20.0]}
    fields = {knob.field for knob in knobs_of(load_config("riddle2023-rods", lists))}
    assert "arena.friction" in fields
    assert not fields & lists.keys()
