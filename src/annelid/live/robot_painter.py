"""What is drawn of a robot that a file describes: its geoms, a line for each actuator, forces of the ground."""

from __future__ import annotations

from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.config import RunConfig
from annelid.draw.drawn_worm import DrawnRobot
from annelid.live.history import Moment
from annelid.live.lines_and_arrows import Colors, Lines, Picture, ring_colors, spring_colors
from annelid.morphology import Array

_TENDON, _SITE = int(mujoco.mjtTrn.mjTRN_TENDON), int(mujoco.mjtTrn.mjTRN_SITE)
_WRAPS = {int(mujoco.mjtWrap.mjWRAP_SITE): "site_xpos", int(mujoco.mjtWrap.mjWRAP_JOINT): "xanchor"}
_End = tuple[str, int]


class RobotPainter:
    """Turns the moments of a robot into pictures.

    Attributes:
        model: The compiled robot with its ground.
        arrow_N: Contact force whose arrow is as long as `radius_m`, about two segments' weight, N.
        radius_m: A tenth of the robot's largest extent.
        weight_N: None: it cannot be poked.
        colored: What has the colour of the activation.
        prefix: What the names of the geoms that are drawn begin with: of all.
    """

    weight_N = None
    colored = "actuators, activation 0 to 1"
    prefix = ""

    def __init__(self, config: RunConfig, first: Moment) -> None:
        """Takes the robot and its first moment."""
        robot = config.body.own_model
        assert robot is not None
        self._drawn = DrawnRobot(config)
        self.model = model = self._drawn.model
        self._lines = [self._ends(model.actuator(name).id) for name in robot.actuators]
        self._corners = max(map(len, self._lines))
        self._n_segments = config.body.n_segments
        self._moving = np.flatnonzero(model.body_weldid > 0)
        self.radius_m = float(np.ptp(self._drawn.outline(first.qpos), axis=0).max()) / 10
        weight_N = float(model.body_mass[self._moving].sum() * np.linalg.norm(model.opt.gravity))
        self.arrow_N = float(f"{2.0 * weight_N / self._n_segments:.1g}") if weight_N > 0 else 1.0

    def strand_colors(self) -> Colors:
        """Colours of what is not seen: lines without length, to which the camera is fitted."""
        return np.zeros((len(self._drawn.outline(self.model.qpos0)), 2, 3), dtype=np.uint8)

    def paint(self, moment: Moment) -> Picture:
        """Draws one moment."""
        points = self._drawn.outline(moment.qpos).astype(np.float32)
        rings = np.array([self._filled(ends) for ends in self._lines])
        middles = rings.mean(axis=(1, 2)).reshape(self._n_segments, -1, 3).mean(axis=1)
        arrows = np.stack([middles, middles + self.radius_m * moment.contact_force_N / self.arrow_N], axis=1)
        nothing = np.stack([middles, middles], axis=1).astype(np.float32)
        return Picture(
            strands=np.stack([points, points], axis=1),
            rings=rings.reshape(-1, 2, 3).astype(np.float32),
            ring_colors=ring_colors(moment.activation, self._corners),
            springs=nothing,
            spring_colors=spring_colors(np.zeros(len(nothing))),
            contacts=arrows.astype(np.float32),
            middle=self._drawn.posture.xipos[self._moving].mean(axis=0),
        )

    def places(self, geoms: NDArray[np.int64]) -> tuple[Array, Array]:
        """Returns where geoms are in the moment painted last: centres, m, ``(n, 3)``, and quaternions, ``(n, 4)``."""
        turns = np.zeros((len(geoms), 4))
        for turn, matrix in zip(turns, self._drawn.posture.geom_xmat[geoms], strict=True):
            mujoco.mju_mat2Quat(turn, matrix)
        return self._drawn.posture.geom_xpos[geoms], turns

    def _ends(self, actuator: int) -> list[tuple[_End, _End]]:
        """The lines of an actuator: through the sites of its tendon, between its sites, or from its joint."""
        model = self.model
        kind, (first, second) = int(model.actuator_trntype[actuator]), model.actuator_trnid[actuator].tolist()
        if kind == _TENDON:
            wraps = range(model.tendon_adr[first], model.tendon_adr[first] + model.tendon_num[first])
            found = [(_WRAPS[t], int(model.wrap_objid[w])) for w in wraps if (t := int(model.wrap_type[w])) in _WRAPS]
            return [*pairwise(found)] or [(found[0], found[0])]
        if kind == _SITE:
            return [(("site_xpos", first), ("site_xpos", second if second >= 0 else first))]
        return [(("xanchor", first), ("xipos", int(model.jnt_bodyid[first])))]

    def _filled(self, ends: list[tuple[_End, _End]]) -> Lines:
        """The places of an actuator's lines; the last is repeated where others have more."""
        lines = [[getattr(self._drawn.posture, array)[place] for array, place in pair] for pair in ends]
        return np.array(lines + lines[-1:] * (self._corners - len(lines)), dtype=np.float32)
