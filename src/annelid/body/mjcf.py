"""A worm in its arena as MJCF, for plain MuJoCo, with the states that it may start from as keyframes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from annelid.body.assemble import build_spec, compile_spec
from annelid.body.worm import WormBody
from annelid.config import RunConfig
from annelid.errors import ConfigError


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
    rest = [{"name": "rest", "act": at_rest}] if len(at_rest) else []
    for keyframe in (*rest, *keyframes):
        spec.add_key(**{name: value for name, value in keyframe.items() if np.size(value)})
    compile_spec(spec)
    return spec.to_xml()
