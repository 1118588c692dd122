"""The virtual load frame: the cable of one interior ring is slowly wound in and let out, and its tension read.

The worm floats without weight and without ground. The frame is there for the mesh's own resistance; gravity would press
the lower half of the free ends and add a force that depends on how the physical segment was held, which is not known.
The ring's forces balance one another, so nothing has to hold the worm.

The ring's length is prescribed through a stiff spring that pulls and pushes. A cable that goes slack and taut again
would be the truer picture, but it is a switch that large steps do not resolve (at 20 ms the tension jumps between 0 and
twice its mean); so where friction holds the ring back on its way out the tension reads below 0, as it did on the robot.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from annelid.arena.kinds.floor import Floor
from annelid.body import build_spec, compile_spec, mesh_of
from annelid.body.actuation import crossing_site, ring_names
from annelid.body.worm import WormBody
from annelid.config import RunConfig
from annelid.errors import ConfigError, SimulationStopped
from annelid.experiment.calibration.loop import Loop

CABLE_N_PER_M = 20_000.0
"""Stiffness of the cable: 15 N stretch it by less than a millimetre."""
SETTLE_S = 2.0
"""Time in which springs that are stretched at rest bring the mesh to its balance before the cable moves."""
SAMPLES = 400
"""Samples of one way, at most."""
MOST_STEPS = 500_000
"""Steps of one way, at most: some minutes."""
FEWEST_STEPS = 100
"""Steps of one way, at least."""
MOST_UNROUND = 0.5
"""Largest spread of the ring's corners about its centre, of their mean distance, before the ring counts as buckled."""
LARGEST_FALL, LARGEST_FALL_N = 0.2, 0.5
"""Largest fall of the tension on the way in, of its peak and beside it, before the ring counts as buckled."""

FrameProgress = Callable[[float], object]
"""Called with the share of the loop that is done."""


def load_frame(
    config: RunConfig,
    *,
    displacement_m: float = 0.33,
    speed_m_per_s: float = 0.01,
    haste: float = 8.0,
    progress: FrameProgress | None = None,
) -> Loop:
    """Winds the cable of the middle segment's ring in and lets it out again.

    Args:
        config: A 3D worm; its arena, controller and the forces of its rings have no part in this.
        displacement_m: How far the cable is wound, m.
        speed_m_per_s: Speed of the cable, m/s.
        haste: The loop is simulated so many times as fast, with every viscous coefficient of the body divided by as
            much: the same viscous forces, and the same result as long as inertia plays no part.
        progress: Called as the loop goes on.

    Returns:
        Shortening of the ring against its settled length, and the tension of its cable (the mean where there are
        two half-rings, whose cables are wound alike).

    Raises:
        ConfigError: The body is planar, or displacement, speed or haste is out of range.
        SimulationStopped: The ring buckled, or the engine gave up.
    """
    body = config.body
    if not isinstance(body, WormBody):
        raise ConfigError(f"body.kind = {body.kind!r} has no ring cable; only the 3D worm (body.kind = 'worm') has")
    if not (0.0 < speed_m_per_s < np.inf and 1.0 <= haste < np.inf):
        raise ConfigError(f"speed = {speed_m_per_s:g} m/s must be greater than 0, and haste = {haste:g} at least 1")
    model, tendons, corners = _compiled(_hastened(config, body, haste))
    data = mujoco.MjData(model)
    _steps(model, data, round(SETTLE_S / model.opt.timestep))
    _locate(model, data)
    start = data.ten_length[tendons].copy()
    if not 0.0 < displacement_m < 0.8 * start.sum():
        raise ConfigError(
            f"displacement = {displacement_m:g} m must be greater than 0 and less than {0.8 * start.sum():.3g} m, "
            "four fifths of the ring"
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


def _hastened(config: RunConfig, body: WormBody, haste: float) -> RunConfig:
    """Returns the worm weightless and away from the ground, with its viscous coefficients divided."""
    damping = ("joint_damping_Nms_per_rad", "damping_time_s", "loss_factor")
    strands = {name: value / haste for name in damping if (value := getattr(body.strands, name)) is not None}
    changed: dict[str, object] = {"strands": body.strands.model_copy(update=strands)}
    changed["formulation"] = body.formulation.hastened(haste)
    if body.joints is not None:
        viscous = {"viscous_friction_Nms_per_rad": body.joints.viscous_friction_Nms_per_rad / haste}
        changed["joints"] = body.joints.model_copy(update=viscous)
    afloat = Floor(gravity_m_per_s2=0.0, floor_gap_m=10.0)
    return config.model_copy(update={"body": body.model_copy(update=changed), "arena": afloat})


def _compiled(config: RunConfig) -> tuple[mujoco.MjModel, np.ndarray, np.ndarray]:
    """Builds the worm without muscles; returns it with the middle ring's tendons and the ring's sites."""
    body = config.body
    assert isinstance(body, WormBody)
    spec = build_spec(config)
    for sensor in spec.sensors:
        if sensor.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR:
            spec.delete(sensor)
    for actuator in spec.actuators:
        spec.delete(actuator)
    names = np.array(ring_names(body.n_segments, body.rings)).reshape(body.n_segments, -1)
    middle = body.n_segments // 2
    # The engine wants a spring at compile time to keep one later: next to none, and slack.
    for name in names[middle]:
        tendon = spec.tendon(name)
        tendon.stiffness, tendon.springlength = [1e-9, 0.0, 0.0], [0.0, 10.0]
    model = compile_spec(spec)
    tendons = np.array([model.tendon(name).id for name in names[middle]])
    ring = mesh_of(body.mesh).rings[middle].tolist()
    corners = np.array([model.site(crossing_site(crossing)).id for crossing in ring])
    return model, tendons, corners


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
    """Tells how a ring has snapped through on its way in, or None as long as it resists.

    Args:
        corners_m: Corners of the ring, ``(n, 3)``.
        tension_N: Tension of its cable so far, ``(k,)``.
    """
    distance = np.linalg.norm(corners_m - corners_m.mean(axis=0), axis=1)
    if np.ptp(distance) > MOST_UNROUND * distance.mean():
        return f"its corners lie {1e3 * distance.min():.0f} to {1e3 * distance.max():.0f} mm from its centre"
    peak = float(tension_N.max())
    if tension_N[-1] < peak - LARGEST_FALL_N - LARGEST_FALL * peak:
        return f"its tension fell from {peak:.1f} to {tension_N[-1]:.1f} N"
    return None
