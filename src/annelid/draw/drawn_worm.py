"""What a picture shows of a 3D worm or a robot: its compiled model with a picture's lens, light and colours."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.arena.geoms import GROUND_RGBA, PLAIN_RGBA, add_looks
from annelid.body import build_spec, robot_spec, worm_of
from annelid.body.actuation import crossing_site, ring_names
from annelid.body.formulations.rods.net import STRAND_RGBA
from annelid.config import RunConfig
from annelid.draw.camera import FIELD_OF_VIEW_DEG
from annelid.draw.canvas import activation_color
from annelid.draw.overlay import BRIGHT, DIM, Background, Entry, background_of
from annelid.draw.strands import POINTS_PER_SIDE, StrandBodies, strand_curves, tube_faces, tubes
from annelid.protocols import Array

HEADLIGHT = 0.25  # light from the camera; the lamp adds 0.4
CONTRACTED_WIDTH = 1.8  # a contracted ring muscle is drawn this much thicker than a relaxed one
SPRING_RGBA = (0.80, 0.58, 0.16, 1.0)  # axial springs, apart from the red of a contracted ring
QUALITY = {"shadowsize": 2048, "numslices": 10, "numstacks": 4}
"""Of thin rods few facets look like many: with the engine's own numbers shadows would make videos four times slower."""
DRAWN_WIDTH = 1 / 0.16  # tendons have the width that they are built with where the worm's radius at rest is 16 cm
LARGEST_BALL = 0.005 / 0.16  # radius of the ball that is drawn at a crossing, in radii of the worm at rest
SMALLEST_BALL = 1.4  # the same, in radii of the strands, which would hide it
LINK = 0.45  # radius of the bars in a soft crossing, in radii of its ball
FACETS = (28, 16)  # round parts of a robot may be large
LOOKS = "annelid/"
"""What the names of sky, light and floor begin with in a robot's model, as none of its file does."""
WAYPOINT_RGBA = (0.20, 0.55, 0.42, 0.35)
WAYPOINT_HALF_HEIGHT_M = 1e-3
HIDDEN = 5
"""Group of what the engine is not to draw."""
_CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE.value


class DrawnWorm:
    """A 3D worm's compiled model, with a picture's lens and light, and the posture that it is drawn in.

    ``upright`` is the rotation from the model's axes, which lie in a slope, to upright ones, ``(3, 3)``.
    """

    def __init__(self, config: RunConfig, background: str = "floor") -> None:
        body = worm_of(config)
        self._behind = background_of(background)
        spec = build_spec(config)
        _light(spec, self._behind)
        for tendon in spec.tendons:
            tendon.rgba = SPRING_RGBA
        _mark_waypoints(spec, config)
        self._geometry = geometry = body.geometry()
        self._tube_m, self._soft = body.strands.radius_m, not body.has_rigid_crossings
        _add_tubes(spec, strand_curves(geometry.vertices_m, geometry)[0], self._tube_m)
        self.model = model = spec.compile()
        self._strands = StrandBodies(model, geometry)
        self._has_waypoints = config.turning is not None and bool(config.turning.goals.points_m)
        # What is drawn of springs, cables and crossings must not hide the mesh of a small worm.
        radius_m = max(body.mesh.radii_m)
        model.tendon_width *= DRAWN_WIDTH * radius_m
        self._balls = np.array([model.geom(crossing_site(i)).id for i in range(geometry.n_crossings)])
        model.geom_rgba[self._balls] = self._behind.ball
        ball_m = model.geom_size[self._balls, 0]
        ball_m = np.minimum(ball_m, LARGEST_BALL * radius_m)
        model.geom_size[self._balls, 0] = np.maximum(ball_m, SMALLEST_BALL * body.strands.radius_m)
        self.posture = mujoco.MjData(self.model)
        self.upright = upright(config)
        self._rings = [self.model.tendon(name).id for name in ring_names(body.n_segments, body.rings)]
        self._widths = self.model.tendon_width[self._rings]

    def pose(self, qpos: NDArray[np.floating], activation: NDArray[np.floating] | None = None) -> None:
        """Brings all that is drawn into a posture ``(nq,)``; activation ``(n_muscles,)`` colours the rings."""
        self.posture.qpos[:] = qpos
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex, mujoco.mj_tendon):
            stage(self.model, self.posture)
        if activation is None or not self._rings:
            return
        for ring, width, value in zip(self._rings, self._widths, activation.tolist(), strict=True):
            self.model.tendon_rgba[ring] = (*activation_color(value), 1.0)
            self.model.tendon_width[ring] = width * (1.0 + (CONTRACTED_WIDTH - 1.0) * value)

    def complete(self, scene: mujoco.MjvScene) -> None:
        """Bends the tubes of the strands, and adds bars from the ball of each soft crossing to its strands."""
        points, along = self._strands.curves(self.posture)
        vertices, normals = tubes(points, along, self._tube_m)
        # The skins of a scene's own bodies come first.
        scene.skinvert[-vertices.size :], scene.skinnormal[-vertices.size :] = vertices.ravel(), normals.ravel()
        if not self._soft:
            return
        geometry, pins = self._geometry, self.posture.geom_xpos[self._balls]
        places = points[geometry.crossing_strands, POINTS_PER_SIDE * (geometry.crossing_plane[:, None] + 1)]
        radius_m = LINK * float(self.model.geom_size[self._balls, 0].min())
        rgba = np.array(self._behind.ball, dtype=np.float32)
        for pin, place in zip(pins.repeat(2, axis=0), places.reshape(-1, 3), strict=True):
            if scene.ngeom < scene.maxgeom:
                bar = scene.geoms[scene.ngeom]
                mujoco.mjv_initGeom(bar, _CAPSULE, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
                mujoco.mjv_connector(bar, _CAPSULE, radius_m, pin, place)
                scene.ngeom += 1

    def legend(self) -> list[Entry]:
        """What the colours mean, of what this worm has."""
        model = self.model
        springs = any(model.tendon(i).name.startswith("spring_") for i in range(model.ntendon))
        entries: list[Entry] = [("strand", STRAND_RGBA[0], "line")]
        entries += [("axial spring", SPRING_RGBA, "line")] * springs
        entries += [(f"ring, {name}", activation_color(at), "line") for name, at in (("relaxed", 0), ("contracted", 1))]
        soft = "soft crossing, bars: its opening" if self._soft else "crossing"
        entries.append((soft, self._behind.ball, "ball"))
        return [*entries, *([("waypoint", WAYPOINT_RGBA, "ball")] * self._has_waypoints)]

    def outline(self, qpos: NDArray[np.floating]) -> Array:
        """Points of all strands, whose free ends reach beyond the crossings, in a posture, m, ``(point, 3)``."""
        self.posture.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.posture)
        return self._strands.curves(self.posture)[0].reshape(-1, 3)


class DrawnRobot(DrawnWorm):
    """A robot of one's own likewise; what its file gives no look has the looks of a worm and its ground."""

    def __init__(self, config: RunConfig, background: str = "floor") -> None:
        robot = config.body.own_model
        assert robot is not None
        self._behind, self.upright = background_of(background), np.eye(3)
        spec = robot_spec(config)
        for number, geom in enumerate(spec.geoms):
            geom.name = geom.name or f"{LOOKS}{number}"
        alone = spec.copy().compile()
        add_looks(spec, float(alone.stat.extent), prefix=LOOKS)
        for geom in spec.geoms:
            if geom.material or not np.allclose(geom.rgba, PLAIN_RGBA):
                continue
            if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
                geom.material = f"{LOOKS}floor"
            else:
                moves = alone.body_weldid[alone.geom(geom.name).bodyid[0]] > 0
                geom.rgba = STRAND_RGBA[0] if moves else GROUND_RGBA
        _light(spec, self._behind, f"{LOOKS}floor")
        spec.visual.quality.numslices, spec.visual.quality.numstacks = FACETS
        for tendon in spec.tendons:
            tendon.rgba = SPRING_RGBA if np.allclose(tendon.rgba, PLAIN_RGBA) else tendon.rgba
        self.model = model = spec.compile()
        self.posture = mujoco.MjData(model)
        pulled = [(model.actuator(name).trntype[0], model.actuator(name).trnid[0]) for name in robot.actuators]
        by_tendon = all(kind == mujoco.mjtTrn.mjTRN_TENDON.value for kind, _ in pulled)
        self._rings = [int(tendon) for _, tendon in pulled] if by_tendon else []
        self._widths = model.tendon_width[self._rings]

    def complete(self, scene: mujoco.MjvScene) -> None:
        """Adds nothing: a file describes all that is seen."""

    def outline(self, qpos: NDArray[np.floating]) -> Array:
        """Corners of boxes about all parts that move, in a posture, m, ``(point, 3)``."""
        model, posture = self.model, self.posture
        parts = np.flatnonzero(model.body_weldid[model.geom_bodyid] > 0)
        posture.qpos[:] = qpos
        mujoco.mj_kinematics(model, posture)
        reach = np.vstack([np.eye(3), -np.eye(3)])[:, None] * model.geom_rbound[parts][None, :, None]
        return (posture.geom_xpos[parts] + reach).reshape(-1, 3)

    def legend(self) -> list[Entry]:
        """What the colours of rings mean, where there are any."""
        states = (("relaxed", 0), ("contracted", 1)) if self._rings else ()
        return [(f"ring, {name}", activation_color(at), "line") for name, at in states]


def upright(config: RunConfig) -> Array:
    """Returns the rotation from the model's axes, which lie in a slope, to upright ones, ``(3, 3)``."""
    slope = config.arena.slope_rad if config.arena is not None else 0.0
    c, s = math.cos(slope), math.sin(slope)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def dim(model: mujoco.MjModel, elevation_deg: float) -> None:
    """Dims the light from all sides where the checkerboard would be white: steep views take more of the headlight."""
    steepness = abs(math.sin(math.radians(elevation_deg)))
    if model.vis.headlight.ambient[0] < BRIGHT:
        model.vis.headlight.ambient[:] = min(DIM, DIM + 0.1 - HEADLIGHT * steepness)


def set_fog(model: mujoco.MjModel, start_m: float, end_m: float) -> None:
    """Lets the haze begin and be full at distances from the camera, m."""
    model.vis.map.fogstart, model.vis.map.fogend = start_m / model.stat.extent, end_m / model.stat.extent


def _light(spec: mujoco.MjSpec, behind: Background, material: str = "floor") -> None:
    """Gives a model a picture's lens and light, and floor and sky the colours of the background."""
    visual = spec.visual
    visual.global_.fovy = FIELD_OF_VIEW_DEG
    visual.headlight.diffuse = [HEADLIGHT] * 3
    visual.headlight.specular = [0.05] * 3
    visual.headlight.ambient = [behind.ambient] * 3
    for name, number in QUALITY.items():
        setattr(visual.quality, name, number)
    visual.rgba.fog = [*behind.haze, 1.0]
    if behind.floor is not None:
        floor = spec.material(material)
        floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = ""
        floor.rgba = [*behind.floor, 1.0]
        for texture in spec.textures:
            if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
                texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
                texture.rgb1 = texture.rgb2 = behind.haze
    visual.map.fogstart, visual.map.fogend = 4.0, 12.0
    for light in spec.lights:
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.diffuse = [0.4] * 3
        light.specular = [0.1] * 3


def _add_tubes(spec: mujoco.MjSpec, curves_m: Array, radius_m: float) -> None:
    """Adds tubes in place of the elements of strands: two skins, whose vertices `DrawnWorm.complete` places."""
    for part in (*spec.flexes, *spec.geoms):
        name = part.name if isinstance(part, mujoco.MjsFlex) else part.parent.name
        if name.startswith("strand_"):
            part.group = HIDDEN
    half, n_points, _ = curves_m[::2].shape
    faces = tube_faces(half, n_points)
    for number, rgba in enumerate(STRAND_RGBA):
        skin = spec.add_skin(name=f"strands_{number}", rgba=rgba)
        n_vertices = int(faces.max()) + 1
        skin.vert, skin.face = np.zeros(3 * n_vertices).tolist(), faces.ravel().tolist()
        skin.bodyname, skin.bindpos, skin.bindquat = ["world"], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
        skin.vertid, skin.vertweight = [list(range(n_vertices))], [[1.0] * n_vertices]


def _mark_waypoints(spec: mujoco.MjSpec, config: RunConfig) -> None:
    """Puts a disc on the floor where each waypoint of a course counts as reached."""
    if config.turning is None or config.arena is None:
        return
    goals = config.turning.goals
    for x, y in goals.points_m:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            pos=[x, y, WAYPOINT_HALF_HEIGHT_M - config.arena.floor_depth_m],
            size=[goals.reach_m, WAYPOINT_HALF_HEIGHT_M, 0.0],
            rgba=WAYPOINT_RGBA,
            contype=0,
            conaffinity=0,
        )
