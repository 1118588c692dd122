"""The load frame: loops of force against displacement of a ring's cable, measured or simulated.

In the virtual frame the cable of one interior ring is slowly wound in and let out, and its tension read. The worm
floats without weight and without ground, for the mesh's own resistance only: how the physical segment was supported is
not known. The ring's forces balance one another, so nothing has to fix the worm in place.

The ring's length is prescribed through a stiff spring that pulls and pushes: large steps do not resolve a cable that
goes slack and taut again (at 20 ms the tension jumps between 0 and twice its mean). So where friction keeps the ring
back as it is let out the tension reads below 0, as it did on the robot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources
from math import inf, pi, sin
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from rich.table import Table
from scipy.stats import binned_statistic

from annelid.arena import Floor
from annelid.body import WormBody, build_spec, compile_spec, crossing_site, ring_names, worm_of, wrap_factors
from annelid.config import RunConfig
from annelid.draw import canvas, draw_lines, save_both
from annelid.errors import AnnelidError, ConfigError, SimulationStopped
from annelid.morphology import Array
from annelid.output import write_csv
from annelid.textfiles import read_text

MEASURED = "segment_load_frame.csv"
MM = 1e-3
MEASURED_RADIUS_M = 0.16
"""Radius of the robot whose segment was measured; other worms are wound in proportion."""
DISPLACEMENT_M, SPEED_M_PER_S = 0.33, 0.01
"""How far and how fast the cable of the robot was wound."""
CABLE_N_PER_M = 20_000.0
"""Stiffness of the cable: 15 N stretch it by less than a millimetre."""
SETTLE_S = 2.0
"""Time in which springs that are stretched at rest bring the mesh to its balance before the cable moves."""
SAMPLES = 400
"""Samples of one branch, at most."""
FEWEST_STEPS, MOST_STEPS = 100, 500_000
"""Steps of one branch; the most take some minutes."""
MOST_UNROUND = 0.5
"""Largest spread of the ring's corners about its centre, of their mean distance, before the ring counts as buckled."""
LARGEST_FALL, LARGEST_FALL_N = 0.2, 0.5
"""Largest fall of the tension while wound in, of its peak and beside it, before the ring counts as buckled."""


@dataclass(frozen=True)
class Loop:
    """The cable is wound in and let out again.

    Attributes:
        displacement_m: How far the cable is wound, ``(n,)``; it rises to its greatest value and falls again.
        force_N: Force of the cable, ``(n,)``.
    """

    displacement_m: Array
    force_N: Array

    @property
    def turn(self) -> int:
        """Index of the turning point."""
        return int(self.displacement_m.argmax())

    def work_J(self) -> tuple[float, float]:
        """Work done by the cable as it is wound in, and work that it gets back as it is let out, J."""
        x, force, turn = self.displacement_m, self.force_N, self.turn
        done = np.trapezoid(force[: turn + 1], x[: turn + 1])
        return float(done), -float(np.trapezoid(force[turn:], x[turn:]))

    def lost_share(self) -> float:
        """Share of the work done that does not come back."""
        done, back = self.work_J()
        return 1.0 - back / done

    def places(self, n: int) -> Array:
        """Displacements at which loops are compared, m, ``(n,)``: even, and clear of both ends of this one.

        At the start a cable is slack, and where it turns its force falls while cable and joints still stick: over 20 mm
        on the robot, which `cable_force` leaves out.
        """
        return np.arange(1, n + 1) / (n + 2) * float(self.displacement_m.max())

    def branches(self, at_m: Array, values: Array | None = None) -> Array:
        """Mean force, N, about displacements on both branches, loading first, ``(2, k)``.

        There are at least two displacements, ``(k,)``, evenly spaced; a mean reaches half a spacing to both sides.
        With values, ``(n,)``, these stand in place of the force.
        """
        values = self.force_N if values is None else values
        half = (at_m[1] - at_m[0]) / 2
        edges: Any = np.append(at_m - half, at_m[-1] + half)
        branches = (slice(None, self.turn + 1), slice(self.turn, None))
        found = [binned_statistic(self.displacement_m[one], values[one], bins=edges) for one in branches]
        means = np.array([one.statistic for one in found])
        if len(empty := np.flatnonzero(np.isnan(means).any(axis=0))):
            x = self.displacement_m
            raise AnnelidError(
                f"the loop has no sample near {at_m[empty[0]] / MM:g} mm: it covers "
                f"{x.min() / MM:.0f} to {x.max() / MM:.0f} mm with {len(x)} samples"
            )
        return means


def read_loop(path: str | Path | None = None) -> Loop:
    """Reads a measured loop: columns displacement (mm), force (N) and perhaps more, comma-separated, no header.

    Without a path it is the load-frame test that comes with annelid (its source is in ``data/README.md``).
    """
    source = resources.files("annelid_lab") / "data" / MEASURED if path is None else Path(path)
    text = read_text(source) if isinstance(source, Path) else source.read_text(encoding="utf-8")
    try:
        table = np.loadtxt(text.splitlines(), delimiter=",", ndmin=2)
    except ValueError as error:
        raise AnnelidError(f"{source} is no table of numbers: {str(error).splitlines()[0]}") from None
    if table.shape[1] < 2:
        raise AnnelidError(f"{source} has {table.shape[1]} column: displacement (mm) and force (N) are needed")
    table = table[np.isfinite(table[:, :2]).all(axis=1)]
    return loop_of_table(table[:, 0] * MM, table[:, 1].copy(), str(source))


def loop_of_table(displacement_m: Array, force_N: Array, source: str) -> Loop:
    """Returns columns of a table, ``(n,)``, as a loop; an error that names the source where it does not turn within."""
    if not len(displacement_m) or not 0 < displacement_m.argmax() < len(displacement_m) - 1:
        raise AnnelidError(f"{source} does not go there and back: its displacement is greatest at an end")
    return Loop(displacement_m, force_N)


def cable_force(loop: Loop, friction: float) -> Loop:
    """Turns the mean tension of a ring's cable into the force at the cable's pulled end, by `wrap_factors`.

    Where the cable turns it first sticks: its end keeps pulling less while nothing moves. That transition takes no
    displacement and is left out.
    """
    if not 0.0 <= friction < inf:
        raise AnnelidError(f"cable friction = {friction:g} must be a finite number of at least 0")
    inwards, outwards = wrap_factors(friction)
    factor = np.where(np.arange(len(loop.force_N)) <= loop.turn, inwards, outwards)
    return Loop(loop.displacement_m, factor * loop.force_N)


def size_of(config: RunConfig) -> float:
    """Returns how large a 3D worm's middle ring is over that of the robot that was measured.

    Raises:
        ConfigError: The body is no 3D worm.
    """
    mesh = worm_of(config).mesh
    return mesh.radii_m[mesh.n_segments // 2] / MEASURED_RADIUS_M


def load_frame(
    config: RunConfig,
    *,
    displacement_m: float | None = None,
    diameter_share: float | None = None,
    speed_m_per_s: float | None = None,
    haste: float = 8.0,
    progress: Callable[[float], object] | None = None,
) -> Loop:
    """Winds the cable of the middle segment's ring in and lets it out again.

    Args:
        config: A 3D worm; its arena, controller and the forces of its rings have no part in this.
        displacement_m: How far the cable is wound, m; by default as on the robot, in proportion to the radius.
        diameter_share: The same as a share of the ring's settled length, and so of its diameter.
        speed_m_per_s: Speed of the cable, m/s; by default likewise.
        haste: The loop is simulated so many times as fast, with every viscous coefficient of the body divided by as
            much: the same viscous forces, and the same result as long as inertia plays no part.
        progress: Called with the share of the loop that is done.

    Returns:
        Shortening of the ring against its settled length, and the tension of its cable (the mean where there are
        two half-rings, whose cables are wound alike).

    Raises:
        ConfigError: The body is no 3D worm, or displacement, speed or haste is out of range.
        SimulationStopped: The ring buckled, or the engine gave up.
    """
    body, size = worm_of(config), size_of(config)
    speed_m_per_s = SPEED_M_PER_S * size if speed_m_per_s is None else speed_m_per_s
    if not (0.0 < speed_m_per_s < np.inf and 1.0 <= haste < np.inf):
        raise ConfigError(f"speed = {speed_m_per_s:g} m/s must be greater than 0, and haste = {haste:g} at least 1")
    model, tendons, corners = _compiled(_sped_up(config, body, haste), body)
    data = mujoco.MjData(model)
    _steps(model, data, round(SETTLE_S / model.opt.timestep))
    _locate(model, data)
    start = data.ten_length[tendons].copy()
    if displacement_m is None:
        displacement_m = DISPLACEMENT_M * size if diameter_share is None else diameter_share * float(start.sum())
    if not 0.0 < displacement_m < 0.8 * start.sum():
        raise ConfigError(
            f"displacement = {displacement_m:g} m must be greater than 0 and less than {0.8 * start.sum():.3g} m, "
            "four fifths of the ring: set a smaller displacement, or a diameter share below 0.8"
        )
    wanted = displacement_m / (haste * speed_m_per_s) / model.opt.timestep
    if wanted > MOST_STEPS:
        raise ConfigError(
            f"speed = {speed_m_per_s:g} m/s takes {wanted:.3g} steps to {displacement_m:g} m, more than "
            f"{MOST_STEPS:,}: raise the speed or lessen the displacement"
        )
    steps = max(round(wanted), FEWEST_STEPS)
    per_sample = -(-steps // SAMPLES)
    samples = -(-steps // per_sample)
    stiffness = CABLE_N_PER_M * len(tendons)
    model.tendon_stiffness[tendons] = stiffness
    x, tension = np.zeros((2, 2 * samples + 1))
    rest = start
    for sample in range(1, 2 * samples + 1):
        for part in range(per_sample):
            done = (sample - 1 + (part + 1) / per_sample) / samples
            rest = start * (1.0 - displacement_m * min(done, 2.0 - done) / start.sum())
            model.tendon_lengthspring[tendons] = rest[:, np.newaxis]
            _steps(model, data, 1)
        _locate(model, data)
        length = data.ten_length[tendons]
        x[sample] = (start - length).sum()
        tension[sample] = (stiffness * (length - rest)).mean()
        snap = gave_way(data.site_xpos[corners], tension[: sample + 1]) if sample <= samples else None
        if snap is not None:
            raise SimulationStopped(f"the ring buckled at {1e3 * x[sample]:.0f} mm of cable: {snap}")
        if progress is not None:
            progress(sample / (2 * samples))
    return Loop(x, tension)


def _sped_up(config: RunConfig, body: WormBody, haste: float) -> RunConfig:
    """Returns the worm weightless and away from the ground, with its viscous coefficients divided."""
    damping = {"damping_time_s": body.strands.damping_time_s / haste}
    changed: dict[str, object] = {"strands": body.strands.model_copy(update=damping)}
    viscous = {name: value / haste for name, value in body.formulation if name.endswith("_Ns_per_m")}
    changed["formulation"] = body.formulation.model_copy(update=viscous)
    if body.joints is not None:
        viscous = {"viscous_friction_Nms_per_rad": body.joints.viscous_friction_Nms_per_rad / haste}
        changed["joints"] = body.joints.model_copy(update=viscous)
    afloat = Floor(gravity_m_per_s2=0.0, floor_gap_m=10.0)
    return config.model_copy(update={"body": body.model_copy(update=changed), "arena": afloat})


def _compiled(config: RunConfig, body: WormBody) -> tuple[mujoco.MjModel, np.ndarray, np.ndarray]:
    """Builds the worm without muscles; returns it with the middle ring's tendons and the ring's sites."""
    spec = build_spec(config)
    for sensor in spec.sensors:
        if sensor.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR:
            spec.delete(sensor)
    for actuator in spec.actuators:
        spec.delete(actuator)
    middle = body.n_segments // 2
    names = np.array(ring_names(body.n_segments, body.rings)).reshape(body.n_segments, -1)[middle]
    # The engine wants a spring at compile time to keep one later: next to none, and slack.
    for name in names:
        tendon = spec.tendon(name)
        tendon.stiffness, tendon.springlength = [1e-9, 0.0, 0.0], [0.0, 10.0]
    model = compile_spec(spec)
    ring = body.geometry().rings[middle].tolist()
    corners = np.array([model.site(crossing_site(crossing)).id for crossing in ring])
    return model, np.array([model.tendon(name).id for name in names]), corners


def _locate(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Brings lengths up to the coordinates, which is not part of a step."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)


def _steps(model: mujoco.MjModel, data: mujoco.MjData, n_steps: int) -> None:
    try:
        mujoco.mj_step(model, data, n_steps)
    except mujoco.FatalError as error:
        raise SimulationStopped(f"the load frame stopped: {error}") from None
    if data.warning.number[int(mujoco.mjtWarning.mjWARN_BADQACC)] or not np.isfinite(data.qpos).all():
        raise SimulationStopped("the load frame stopped: a position became unbounded")


def gave_way(corners_m: np.ndarray, tension_N: np.ndarray) -> str | None:
    """Says how a ring has snapped through as it is wound in, or None as long as it resists.

    From its corners, ``(n, 3)``, and the tension of its cable so far, ``(k,)``.
    """
    distance = np.linalg.norm(corners_m - corners_m.mean(axis=0), axis=1)
    if np.ptp(distance) > MOST_UNROUND * distance.mean():
        return f"its corners lie {1e3 * distance.min():.0f} to {1e3 * distance.max():.0f} mm from its centre"
    peak = float(tension_N.max())
    if tension_N[-1] < peak - LARGEST_FALL_N - LARGEST_FALL * peak:
        return f"its tension fell from {peak:.1f} to {tension_N[-1]:.1f} N"
    return None


def cable_per_diameter(config: RunConfig) -> float:
    """Returns how far a cable is wound for a change of diameter: the ring is a polygon of its crossings, 3 for six."""
    corners = worm_of(config).mesh.n_helices // 2
    return corners * sin(pi / corners)


def frame_table(loops: Mapping[str, Loop], per_diameter: float) -> Table:
    """Tabulates loops side by side: force on both branches, peak, and the share of the work that is lost.

    Rows divide the change of diameter that the first loop reaches.

    Args:
        loops: The loops by their names.
        per_diameter: As `cable_per_diameter` gives it.
    """
    table = Table("diameter change (mm)", title="load frame: force of the cable, wound in / let out (N)")
    step = float(next(iter(loops.values())).displacement_m.max()) / 33
    columns = []
    for name, loop in loops.items():
        table.add_column(name, justify="right")
        reached = np.arange(step, loop.displacement_m.max() - step / 2, step)
        columns.append(loop.branches(reached)[:, 2::3] if len(reached) > 1 else np.empty((2, 0)))
    for row in range(10):
        cells = [f"{c[0, row]:.3g} / {c[1, row]:.3g}" if row < c.shape[1] else "" for c in columns]
        table.add_row(f"{(row + 1) * 3 * step / per_diameter / MM:.3g}", *cells)
    table.add_row("peak (N)", *(f"{loop.force_N.max():.3g}" for loop in loops.values()))
    table.add_row("work lost", *(f"{loop.lost_share():.1%}" for loop in loops.values()))
    return table


def draw_loops(loops: Mapping[str, Loop], stem: Path, per_diameter: float) -> Path:
    """Draws loops over one another, the first in front, as ``.svg`` and ``.png``; returns the path of the latter."""
    with canvas(3.6) as figure:
        axes = figure.subplots()
        lines = {name: (loop.displacement_m / MM, loop.force_N) for name, loop in loops.items()}
        draw_lines(axes, lines, marker="")
        for order, line in enumerate(axes.lines):
            line.set(zorder=3 - order, linewidth=0.9 if order else 1.6)
        displacement = f"displacement of the cable (mm), {per_diameter:.3g} times the change of diameter"
        axes.set(xlabel=displacement, ylabel="force of the cable (N)")
        axes.legend(loc="upper left")
        return save_both(figure, stem)


def write_loop(loop: Loop, tension: Loop, path: Path) -> Path:
    """Writes a simulated loop as CSV with a header: its displacement and force, and the mean tension round the ring."""
    rows = zip(loop.displacement_m / MM, loop.force_N, tension.force_N, strict=True)
    columns = ["displacement_mm", "force_N", "tension_N"]
    return write_csv(path, columns, ([f"{value:.6g}" for value in row] for row in rows))
