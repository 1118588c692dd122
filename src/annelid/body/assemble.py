"""Assembles the spec of a worm in its arena: mesh, springs, muscles, floor; and writes it as MJCF."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np

from annelid.arena.geoms import SCENE, add_moving_planes, add_scenery, add_walls
from annelid.arena.ground import gravity_of
from annelid.body.actuation import (
    add_joint_friction,
    add_length_sensor,
    add_ring_actuators,
    add_springs,
    stretch_sensors,
)
from annelid.body.worm import worm_of
from annelid.config import RunConfig
from annelid.errors import ConfigError, shortened

MOST_ORDERED_BODIES = 8192
"""Above this the engine's solver does not order its unknowns (docs/evidence/sparse_ordering.md)."""
_log = logging.getLogger(__name__)
# Otherwise the engine prints its warnings and writes them to a file in the user's folder; plants report them.
mujoco.set_mju_user_warning(lambda message: _log.info("%s", message))
_SHORT = "lengthen body.mesh.rear_overhang_m and body.mesh.radius_m, or lessen body.mesh.elements_per_side"
_REMEDIES = {
    "mass and inertia of moving bodies": "a part is too light, so raise body.strands.linear_density_kg_per_m, "
    f"body.strands.radius_m, body.pins.mass_kg or body.pins.radius_m, or it is too short: {_SHORT}",
    "degenerate": f"a part is too short: {_SHORT}",
    "too close": f"a part is too short: {_SHORT}",
}
"""What the engine may say of a body whose every number is in its range, and the fields that it means."""


def build_spec(config: RunConfig, *, for_plant: bool = False) -> mujoco.MjSpec:
    """Builds the MuJoCo spec of a 3D worm in its arena.

    Names in the spec: sites ``crossing_<i>``, tendons ``spring_<k>`` and ``ring_<s>`` (or ``ring_<s>_left``
    and ``_right``), actuators the same as the rings, strands ``strand_<s>``.

    Args:
        config: The run's configuration; ``body`` must be a 3D worm.
        for_plant: For a plant of annelid, which prepares every step: rows whose coefficients follow the posture
            (`annelid.body.constraint_rows`), and where the engine has no one plane for the ground planes that are
            laid under the skin (`annelid.simulation.ground`), with nothing to see. Else a model that moves by itself:
            the engine's rods, all that is seen, and panels that support the worm in plain MuJoCo.

    Returns:
        A spec of its own for every call; compile it as it is or a copy of it.

    Raises:
        ConfigError: The body is no 3D worm, of which alone annelid makes a MuJoCo model.
    """
    body, arena = worm_of(config), config.arena
    assert arena is not None
    geometry = body.geometry()
    spec = mujoco.MjSpec()
    spec.modelname = config.name
    spec.compiler.degree = False
    step_s, share = config.clock.physics_timestep_s, body.formulation.engine_share(arena) if for_plant else 1.0
    spec.option.timestep = step_s * share
    if share < 1.0:
        # In steps of second order a worm at rest chatters on contacts that are stiffer, on curved ground sooner.
        softest_s = step_s * (1.5 if arena.has_moving_planes else 1.0)
        arena = arena.model_copy(update={"contact_time_constant_s": max(arena.contact_time_constant_s, softest_s)})
    spec.option.gravity = gravity_of(arena)
    spec.stat.extent = geometry.length_m
    spec.stat.center = [geometry.length_m / 2, 0.0, geometry.radius_m]
    body.formulation.add(spec, geometry, body, arena, for_plant=for_plant)
    add_springs(spec, geometry, body.springs)
    add_ring_actuators(spec, geometry, body.rings)
    if body.joints is not None:
        add_joint_friction(spec, geometry, body.joints)
    if for_plant and arena.has_moving_planes:
        add_moving_planes(spec, arena)
        add_walls(spec, arena)
    else:
        add_scenery(spec, arena, geometry.length_m)
    return spec


def robot_spec(config: RunConfig) -> mujoco.MjSpec:
    """Returns the spec of a robot that a file describes, with the scene that is its arena, if any, and its gravity.

    Raises:
        ConfigError: The engine refuses the file or the scene.
    """
    assert config.body.own_model is not None
    with _refused():
        spec = mujoco.MjSpec.from_string(config.body.own_model.xml)
    if config.arena is not None:
        spec.option.gravity = gravity_of(config.arena)
        config.arena.add_own(spec)
        for geom in spec.geoms:
            # The look of a worm's floor, which a robot's file need not have.
            geom.material = "" if geom.name.startswith(SCENE) and geom.material == "floor" else geom.material
    return spec


def compile_robot(config: RunConfig) -> mujoco.MjModel:
    """Compiles a robot that a file describes, with the step of its configuration.

    Raises:
        ConfigError: As `robot_spec`.
    """
    spec = robot_spec(config)
    with _refused():
        model = spec.compile()
    model.opt.timestep = config.clock.physics_timestep_s
    return model


@contextmanager
def _refused() -> Iterator[None]:
    try:
        yield
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise ConfigError(f"the engine refuses the robot: {shortened(reason, 200)}") from None


def compile_spec(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compiles a worm.

    Args:
        spec: What `build_spec` returned, with anything added to it.

    Returns:
        The engine's model.

    Raises:
        ConfigError: The engine refuses the model.
    """
    try:
        with warnings.catch_warnings():
            # A plant's model, whose parts are joined so, is not written.
            warnings.filterwarnings("ignore", "Attaching a spec with an empty prefix")
            return spec.compile()
    except ValueError as error:
        reason = str(error).splitlines()[0].removeprefix("Error: ")
        remedy = next((f"{remedy} ({reason})" for words, remedy in _REMEDIES.items() if words in reason), reason)
        raise ConfigError(f"the engine refuses this body: {remedy}") from None


def mjcf_text(config: RunConfig, keyframes: Sequence[Mapping[str, Any]] = ()) -> str:
    """Writes a worm and its arena as MJCF.

    A worm with servos also gets the keyframe ``rest``, in which their cables are paid out: the engine's own reset would
    wind them up whole.

    Args:
        config: The run's configuration.
        keyframes: States to add: what `mujoco.MjSpec.add_key` takes by name, and empty arrays that it is not to take.

    Raises:
        ConfigError: The body is planar or starts with a heading, friction depends on the direction, or the engine
            refuses the model.
    """
    if config.body.own_model is not None:
        return config.body.own_model.xml if config.arena is None else robot_spec(config).to_xml()
    if config.arena is not None and config.arena.has_setae:
        raise ConfigError(
            f"arena.backward_friction = {config.arena.backward_friction} cannot be written as MJCF, whose friction is "
            "the same in both directions: leave it out or run the worm with annelid"
        )
    spec, body = build_spec(config), worm_of(config)
    if body.strands.stiffness_differs and spec.flexes:
        raise ConfigError(
            "body.strands: stiffness that differs along rods cannot be written as MJCF, where a rod has one: take "
            "body.formulation.kind = 'chain', or run the worm with annelid"
        )
    # The springs that annelid senses, by the names under which it drives a robot of one's own.
    for segment, springs in enumerate(stretch_sensors(body.geometry(), body.springs)):
        for number, spring in enumerate(springs):
            add_length_sensor(spec, f"spring_{spring}", f"stretch_{segment}_{number}")
    at_rest = body.rings.act_at_rest(spec)
    rest = [{"name": "rest", "act": at_rest}] if len(at_rest) else []
    for keyframe in (*rest, *keyframes):
        spec.add_key(**{name: value for name, value in keyframe.items() if np.size(value)})
    moving = len({*compile_spec(spec).dof_bodyid.tolist()})
    if spec.flexes and moving > MOST_ORDERED_BODIES:
        warnings.warn(
            f"the written worm has {moving} moving bodies: above {MOST_ORDERED_BODIES} plain MuJoCo takes tens of "
            "times as long a step. Fewer body.mesh.n_segments or body.mesh.elements_per_side help; annelid's own runs "
            "need neither",
            stacklevel=2,
        )
    if spec.flexes and body.mesh.elements_per_side > 1:
        warnings.warn(
            "a rod in MJCF is equally stiff at every vertex, while annelid bends it as forces at its crossings do. The "
            "segments of the written worm elongate by 7 % less than here with two elements a side, by 1 % with six",
            stacklevel=2,
        )
    return spec.to_xml()
