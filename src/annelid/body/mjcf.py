"""A worm in its arena as MJCF, for plain MuJoCo, with the states that it may start from as keyframes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray

from annelid.body.assemble import build_spec, compile_spec
from annelid.body.worm import WormBody
from annelid.config import RunConfig
from annelid.errors import ConfigError

Array = NDArray[np.float64]
REST = "rest"


def _nothing() -> Array:
    return np.empty(0)


@dataclass(frozen=True, slots=True)
class Keyframe:
    """A state to start from; what is left empty is the model's own at rest.

    Attributes:
        name: Its name in the file.
        time: Simulated time, s.
        qpos: Generalised positions, ``(nq,)``.
        qvel: Generalised velocities, ``(nv,)``.
        act: Actuator states, ``(na,)``.
        ctrl: Controls, ``(nu,)``.
    """

    name: str
    time: float = 0.0
    qpos: Array = field(default_factory=_nothing)
    qvel: Array = field(default_factory=_nothing)
    act: Array = field(default_factory=_nothing)
    ctrl: Array = field(default_factory=_nothing)


def mjcf_text(config: RunConfig, keyframes: Sequence[Keyframe] = ()) -> str:
    """Writes a worm and its arena as MJCF.

    A worm with servos also gets the keyframe ``rest``, in which their cables are paid out: the engine's own reset would
    wind them up whole.

    Args:
        config: The run's configuration.
        keyframes: States to add.

    Raises:
        ConfigError: The body is planar or starts with a heading, friction depends on the direction, or the engine
            refuses the model.
    """
    if config.arena is not None and config.arena.has_setae:
        raise ConfigError(
            f"arena.backward_friction = {config.arena.backward_friction} cannot be written as MJCF, whose friction is "
            "the same in both directions: leave it out or run the worm with annelid"
        )
    spec = build_spec(config)
    assert isinstance(config.body, WormBody)
    if config.body.heading_deg:
        raise ConfigError(
            f"body.heading_deg = {config.body.heading_deg:g} cannot be written as MJCF, whose keyframes lack the "
            "frames of turned rods: set it to 0, or run the worm with annelid"
        )
    at_rest = config.body.rings.act_at_rest(spec)
    if len(at_rest):
        keyframes = (Keyframe(REST, act=at_rest), *keyframes)
    for keyframe in keyframes:
        state = {name: value for name, value in asdict(keyframe).items() if name == "time" or len(value)}
        spec.add_key(**state)
    compile_spec(spec)
    return spec.to_xml()
