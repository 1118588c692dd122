"""A 3D worm drawn by MuJoCo: as a run recorded it, in postures that are given one by one, or once on white."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.arena.geoms import GROUND_RGBA, PLAIN_RGBA, add_looks
from annelid.body import build_spec, worm_of
from annelid.body.actuation import crossing_site, ring_names
from annelid.body.formulations.rods.net import STRAND_RGBA
from annelid.body.rows import tied_bodies
from annelid.config import RunConfig
from annelid.draw.camera import FIELD_OF_VIEW_DEG, FIXED, fitting_distance, picture_points, view_angles
from annelid.draw.canvas import CONTRACTED, activation_color
from annelid.draw.gl import Canvas
from annelid.draw.overlay import BRIGHT, DIM, Background, Entry, Overlay, background_of, bar_length
from annelid.errors import RunFileError
from annelid.protocols import Array
from annelid.simulation.anatomy import Anatomy
from annelid.simulation.objects import in_scene
from annelid.simulation.runfile import Run

ROOM = 1.3
"""A camera that cannot know what is to come keeps this many times the distance from which the worm at rest fits."""
HEADLIGHT = 0.25  # light from the camera; the lamp adds 0.4
CONTRACTED_WIDTH = 1.8  # a contracted ring muscle is drawn this much thicker than a relaxed one
PALE = 3.0  # on white, what lies this many half worms behind its middle would vanish
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
        self.model = model = spec.compile()
        self._has_waypoints = config.turning is not None and bool(config.turning.goals.points_m)
        # What is drawn of springs, cables and crossings must not hide the mesh of a small worm.
        radius_m = max(body.mesh.radii_m)
        model.tendon_width *= DRAWN_WIDTH * radius_m
        self._balls = np.array([model.geom(crossing_site(i)).id for i in range(body.geometry().n_crossings)])
        model.geom_rgba[self._balls] = self._behind.ball
        ball_m = model.geom_size[self._balls, 0]
        ball_m = np.minimum(ball_m, LARGEST_BALL * radius_m)
        model.geom_size[self._balls, 0] = np.maximum(ball_m, SMALLEST_BALL * body.strands.radius_m)
        self._in_scene = in_scene(model)
        connects = model.eq_objtype == mujoco.mjtObj.mjOBJ_BODY.value
        connects &= model.eq_type == mujoco.mjtEq.mjEQ_CONNECT.value
        tied = tied_bodies(model)
        joined = np.stack([model.eq_obj1id[connects], model.eq_obj2id[connects]], axis=-1)
        self._links = np.concatenate([joined, tied])
        places = model.eq_data[connects, :6].reshape(-1, 2, 3)
        self._link_places = np.concatenate([places, np.zeros((len(tied), 2, 3))])
        self.posture = mujoco.MjData(self.model)
        self.upright = upright(config)
        self._rings = [self.model.tendon(name).id for name in ring_names(body.n_segments, body.rings)]
        self._widths = self.model.tendon_width[self._rings]

    def pose(self, qpos: NDArray[np.floating], activation: NDArray[np.floating] | None = None) -> None:
        """Brings all that is drawn into a posture ``(nq,)``; activation ``(n_muscles,)`` colours the rings."""
        self.posture.qpos[:] = qpos
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex, mujoco.mj_tendon):
            stage(self.model, self.posture)
        if activation is None:
            return
        for ring, width, value in zip(self._rings, self._widths, activation.tolist(), strict=True):
            self.model.tendon_rgba[ring] = (*activation_color(value), 1.0)
            self.model.tendon_width[ring] = width * (1.0 + (CONTRACTED_WIDTH - 1.0) * value)

    def add_links(self, scene: mujoco.MjvScene) -> None:
        """Adds a bar for each soft connection of a crossing, from one of its ends to the other."""
        model, posture = self.model, self.posture
        radius_m = LINK * float(model.geom_size[self._balls, 0].min(initial=math.inf))
        capsule, rgba = mujoco.mjtGeom.mjGEOM_CAPSULE.value, np.array(self._behind.ball, dtype=np.float32)
        turn = posture.xmat.reshape(-1, 3, 3)[self._links]
        for ends in posture.xpos[self._links] + (turn @ self._link_places[..., None])[..., 0]:
            if scene.ngeom < scene.maxgeom:
                bar = scene.geoms[scene.ngeom]
                mujoco.mjv_initGeom(bar, capsule, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
                mujoco.mjv_connector(bar, capsule, radius_m, *ends)
                scene.ngeom += 1

    def legend(self) -> list[Entry]:
        """What the colours mean, of what this worm has."""
        model = self.model
        springs = any(model.tendon(i).name.startswith("spring_") for i in range(model.ntendon))
        entries: list[Entry] = [("strand", STRAND_RGBA[0], "line")]
        entries += [("axial spring", SPRING_RGBA, "line")] * springs
        entries += [(f"ring, {name}", activation_color(at), "line") for name, at in (("relaxed", 0), ("contracted", 1))]
        soft = "soft crossing, bars: its opening" if self._links.size else "crossing"
        entries.append((soft, self._behind.ball, "ball"))
        return [*entries, *([("waypoint", WAYPOINT_RGBA, "ball")] * self._has_waypoints)]

    def part_ends(self, qpos: NDArray[np.floating]) -> Array:
        """Both ends of every part of the worm in a posture, m, ``(point, 3)``.

        The strands' free ends reach beyond the crossings, so these would not do.
        """
        model, posture = self.model, self.posture
        parts = np.flatnonzero((model.geom_bodyid > 0) & ~self._in_scene[model.geom_bodyid])
        capsules = model.geom_type[parts] == mujoco.mjtGeom.mjGEOM_CAPSULE.value
        half_lengths = np.where(capsules, model.geom_size[parts, 1], 0.0)
        posture.qpos[:] = qpos
        mujoco.mj_kinematics(model, posture)
        middles, axes = posture.geom_xpos[parts], posture.geom_xmat[parts].reshape(-1, 3, 3)[:, :, 2]
        reach = half_lengths[:, None] * axes
        return np.concatenate([middles - reach, middles + reach])


class DrawnRobot(DrawnWorm):
    """A robot of one's own likewise; what its file gives no look has the looks of a worm and its ground."""

    def __init__(self, config: RunConfig, background: str = "floor") -> None:
        robot = config.body.own_model
        assert robot is not None
        self._behind, self.upright = background_of(background), np.eye(3)
        spec = mujoco.MjSpec.from_string(robot.xml)
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
        self._balls = np.zeros(0, dtype=np.int64)
        self._links, self._link_places = np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2, 3))
        self._in_scene = model.body_weldid == 0
        pulled = [(model.actuator(name).trntype[0], model.actuator(name).trnid[0]) for name in robot.actuators]
        by_tendon = all(kind == mujoco.mjtTrn.mjTRN_TENDON.value for kind, _ in pulled)
        self._rings = [int(tendon) for _, tendon in pulled] if by_tendon else []
        self._widths = model.tendon_width[self._rings]

    def pose(self, qpos: NDArray[np.floating], activation: NDArray[np.floating] | None = None) -> None:
        """Brings all that is drawn into a posture, as `DrawnWorm.pose`; joints that contract have no colour."""
        super().pose(qpos, activation if self._rings else None)

    def part_ends(self, qpos: NDArray[np.floating]) -> Array:
        """Corners of boxes about all parts in a posture, m, ``(point, 3)``."""
        model, posture = self.model, self.posture
        parts = np.flatnonzero(~self._in_scene[model.geom_bodyid])
        posture.qpos[:] = qpos
        mujoco.mj_kinematics(model, posture)
        reach = np.vstack([np.eye(3), -np.eye(3)])[:, None] * model.geom_rbound[parts][None, :, None]
        return (posture.geom_xpos[parts] + reach).reshape(-1, 3)

    def legend(self) -> list[Entry]:
        """What the colours of rings mean, where there are any."""
        states = (("relaxed", 0), ("contracted", 1)) if self._rings else ()
        return [(f"ring, {name}", activation_color(at), "line") for name, at in states]


class _Scene(Canvas):
    """Pictures of a worm from one direction and distance, with or without smooth edges (``fine``) and words on them."""

    def __init__(
        self,
        worm: DrawnWorm,
        size: tuple[int, int],
        angles_deg: tuple[float, float],
        distance_m: float,
        *,
        fine: bool,
        upright: Array | None,
        background: str = "floor",
        words: bool = True,
    ) -> None:
        super().__init__(worm.model, *size, fine=fine, upright=upright)
        self._worm = worm
        self.legend = worm.legend()
        self.pixels_per_m = size[1] / (2.0 * math.tan(math.radians(FIELD_OF_VIEW_DEG) / 2) * distance_m)
        self.bar_m = bar_length(size[0], self.pixels_per_m)
        behind = background_of(background)
        self._overlay = Overlay(size, self.legend, self.pixels_per_m, behind.ink, behind.haze) if words else None
        self.camera.azimuth, self.camera.elevation = angles_deg
        self.camera.distance = distance_m

    def _draw(
        self, qpos: NDArray[np.floating], activation: NDArray[np.floating] | None, target_m: Array, caption: str = ""
    ) -> NDArray[np.uint8]:
        self._worm.pose(qpos, activation)
        self.camera.lookat[:] = target_m
        pixels = self.draw(self._worm.posture, self._worm.add_links)
        return pixels if self._overlay is None else self._overlay.stamped(pixels, caption)


class WormScene(_Scene):
    """Pictures of a 3D worm's run from a named view, see `annelid.draw.camera.VIEWS_DEG`.

    The background is one of `annelid.draw.overlay.BACKGROUNDS`; ``words`` are the legend, a scale bar and the time.
    """

    def __init__(
        self,
        run: Run,
        width: int,
        height: int,
        camera: str,
        *,
        fine: bool,
        background: str = "floor",
        words: bool = True,
    ) -> None:
        body = run.config.body
        angles = view_angles(camera, body.first_heading_deg)
        worm = (DrawnWorm if body.own_model is None else DrawnRobot)(run.config, background)
        self.times_s: Array = run.data["frame_time"].values
        self._qpos = postures_of(run, worm.model.nq)
        self._activation = run.data["activation"]
        points = np.stack([worm.part_ends(qpos) for qpos in self._qpos])
        box_middle = (points.min(axis=(0, 1)) + points.max(axis=(0, 1))) / 2
        seen = run.data["crossing_position"].values if "crossing_position" in run.data else points
        self._target = seen.mean(axis=1)
        self._target[:, 2] = box_middle[2]
        if camera in FIXED:
            self._target[:] = box_middle
        offsets = (points - self._target[:, None]).reshape(-1, 3) @ worm.upright.T
        distance = fitting_distance(offsets, *angles, width / height)
        _dim(worm.model, angles[1])
        if camera in FIXED:
            _set_fog(worm.model, 2.0 * distance, 6.0 * distance)
        look: dict[str, Any] = {"background": background, "words": words}
        super().__init__(worm, (width, height), angles, distance, fine=fine, upright=worm.upright, **look)

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Draws one recorded frame, as pixels of shape ``(height, width, 3)``."""
        time_s = float(self.times_s[frame])
        activation = self._activation.sel(time=time_s, method="nearest").values
        return self._draw(self._qpos[frame], activation, self._target[frame], f"{time_s:.2f} s")


class PostureScene(_Scene):
    """Pictures of a 3D worm in postures that are given one by one, from a named view.

    The camera looks at the worm's middle, from a distance that leaves it room to stretch.
    """

    def __init__(self, config: RunConfig, width: int, height: int, camera: str) -> None:
        # The model's own rest has no heading.
        angles, headed = view_angles(camera), view_angles(camera, config.body.first_heading_deg)
        worm = DrawnWorm(config)
        points = worm.part_ends(worm.model.qpos0)
        offsets = (points - _middle(points)) @ worm.upright.T
        distance = ROOM * fitting_distance(offsets, *angles, width / height)
        _dim(worm.model, angles[1])
        super().__init__(worm, (width, height), headed, distance, fine=False, upright=worm.upright)

    def picture(self, qpos: Array, activation: Array, caption: str) -> NDArray[np.uint8]:
        """Draws a posture, with activation ``(n_muscles,)``, as pixels of shape ``(height, width, 3)``."""
        return self._draw(qpos, activation, _middle(self._worm.part_ends(qpos)), caption)


@dataclass(frozen=True)
class Still:
    """A rendered posture that marks can be drawn on."""

    pixels: NDArray[np.uint8]  # (height, width, 3)
    target_m: Array  # point that the camera looks at, (3,)
    angles_deg: tuple[float, float]  # azimuth and elevation of the line of sight
    distance_m: float  # from the camera to the point that it looks at

    def places(self, points_m: ArrayLike) -> Array:
        """Finds the pixels at which points, m, ``(..., 3)``, appear.

        Returns:
            Columns and rows, counted from the picture's upper left corner, shape ``(..., 2)``.
        """
        height, width = self.pixels.shape[:2]
        offsets = np.asarray(points_m, dtype=float) - self.target_m
        shares = picture_points(offsets, *self.angles_deg, self.distance_m, width / height)
        return shares * [width, height] - 0.5


def render_still(
    config: RunConfig,
    angles_deg: tuple[float, float],
    size: tuple[int, int],
    *,
    qpos: Array | None = None,
    activation: Array | None = None,
) -> Still:
    """Renders one posture on white, without a floor; what lies behind is paler.

    Args:
        config: Configuration of the 3D worm.
        angles_deg: Azimuth and elevation of the line of sight.
        size: Width and height, pixels.
        qpos: The posture as a run records it; by default at rest.
        activation: Colours and widths of the ring muscles; by default all rings and springs are red.

    Raises:
        RenderingUnavailable: No OpenGL back-end works.
    """
    worm = DrawnWorm(config)
    model = worm.model
    if activation is None:
        model.tendon_rgba[:] = (*CONTRACTED, 1.0)
    model.geom_rgba[model.geom_bodyid == 0, 3] = 0.0
    model.vis.headlight.ambient[:] = BRIGHT
    model.vis.rgba.fog[:] = 1.0
    drawn = model.qpos0 if qpos is None else qpos
    points = worm.part_ends(drawn)
    target = _middle(points)
    distance = fitting_distance(points - target, *angles_deg, size[0] / size[1])
    reach = float(np.linalg.norm(points - target, axis=1).max())
    _set_fog(model, distance - reach, distance + PALE * reach)
    with _Scene(worm, size, angles_deg, distance, fine=True, upright=None, words=False) as scene:
        return Still(scene._draw(drawn, activation, target), target, angles_deg, distance)


def postures_of(run: Run, n_coordinates: int) -> NDArray[np.floating]:
    """Returns the generalised positions of every frame of a 3D worm's run, ``(n_frames, n_coordinates)``.

    Args:
        run: The run.
        n_coordinates: Of the body that is built from its configuration.

    Raises:
        RunFileError: No postures were recorded, or those of another body than is built from the configuration.
    """
    data = run.data
    if "qpos" not in data or data.sizes.get("frame", 0) == 0:
        raise RunFileError(f"{run.path} holds no recorded postures to draw")
    if data.sizes["coordinate"] != n_coordinates:
        raise RunFileError(
            f"{run.path} holds postures of {data.sizes['coordinate']} coordinates, but the body built "
            f"from its configuration has {n_coordinates}: it was written by another version"
        )
    return data["qpos"].values


class Skeleton:
    """Where strands and crossings of a compiled worm are in a posture, with an engine state of its own."""

    def __init__(self, anatomy: Anatomy) -> None:
        self.anatomy = anatomy
        self._data = mujoco.MjData(anatomy.model)
        mujoco.mj_kinematics(anatomy.model, self._data)
        vertices = anatomy.geometry.vertices_m
        self._shape = vertices.shape
        self._body = _bodies_of_vertices(anatomy.model, *vertices.shape[:2])
        # At rest the axes of all bodies are the world's.
        self._place = vertices.reshape(-1, 3) - self._data.xpos[self._body]

    def locate(self, qpos: NDArray[np.floating]) -> tuple[Array, Array]:
        """Returns vertices of the strands from front to rear, m, ``(n_strands, n_vertices, 3)``, and the crossings."""
        self._data.qpos[:] = qpos
        crossing, *_ = self.anatomy.locate(self._data)
        turn = self._data.xmat[self._body].reshape(-1, 3, 3)
        vertices = self._data.xpos[self._body] + np.einsum("vij,vj->vi", turn, self._place)
        return vertices.reshape(self._shape), crossing

    def places(self, geoms: NDArray[np.int64]) -> tuple[Array, Array]:
        """Returns centres, m, ``(n, 3)``, and quaternions, ``(n, 4)``, of n geoms in the posture located last."""
        turns = np.empty((len(geoms), 4))
        for turn, axes in zip(turns, self._data.geom_xmat[geoms], strict=True):
            mujoco.mju_mat2Quat(turn, axes)
        return self._data.geom_xpos[geoms], turns


def _bodies_of_vertices(model: mujoco.MjModel, n_strands: int, n_vertices: int) -> NDArray[np.int64]:
    """Body that carries each vertex, strand by strand: its own for rods, the element behind it for a chain."""
    if model.nflex:
        of_strand = []
        for strand in range(n_strands):
            flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, f"strand_{strand}")
            first, count = model.flex_vertadr[flex], model.flex_vertnum[flex]
            of_strand.append(model.flex_vertbodyid[first : first + count])
        return np.concatenate(of_strand).astype(np.int64)
    elements = np.minimum(np.arange(n_vertices), n_vertices - 2)
    return np.array([model.body(f"strand_{strand}_{e}").id for strand in range(n_strands) for e in elements])


def upright(config: RunConfig) -> Array:
    """Returns the rotation from the model's axes, which lie in a slope, to upright ones, ``(3, 3)``."""
    slope = config.arena.slope_rad if config.arena is not None else 0.0
    c, s = math.cos(slope), math.sin(slope)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _middle(points_m: Array) -> Array:
    """Middle of the box about points, m, ``(point, 3)``."""
    return (points_m.min(axis=0) + points_m.max(axis=0)) / 2


def _dim(model: mujoco.MjModel, elevation_deg: float) -> None:
    """Dims the light from all sides where the checkerboard would be white: steep views take more of the headlight."""
    steepness = abs(math.sin(math.radians(elevation_deg)))
    if model.vis.headlight.ambient[0] < BRIGHT:
        model.vis.headlight.ambient[:] = min(DIM, DIM + 0.1 - HEADLIGHT * steepness)


def _set_fog(model: mujoco.MjModel, start_m: float, end_m: float) -> None:
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
