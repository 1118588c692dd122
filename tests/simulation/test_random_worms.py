"""Worms drawn at random about the presets: none is nonsense without an error, a stop or a warning that names it.

Whether a run is nonsense is judged here from what it recorded, without the library's own limits and code for them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, log, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from annelid.arena.kinds.floor import Ground
from annelid.arena.kinds.pipe import Pipe
from annelid.arena.kinds.relief import Rough
from annelid.body.formulations.chain import Chain
from annelid.body.worm import WormBody
from annelid.config import RunConfig, load_config
from annelid.errors import ConfigError, SimulationStopped
from annelid.simulation import open_run, simulate

SEED = 16
N_WORMS = 100
PRESETS = (
    "riddle2023-rods",
    "riddle2023-fast",
    "riddle2023",
    "crawler",
    "crawler-servo",
    "riddle2025",
    "riddle2025-muscles",
    "riddle2025-steered",
    "wang",
)
ARENAS = ("steps", "rough", "pipe", "pipe.bend", "pipe.taper", "pipe.hourglass", "slope", "setae", "rails")
FACTORS = {
    "body.strands.young_modulus_Pa": 16.0,
    "body.strands.shear_modulus_Pa": 4.0,
    "body.strands.radius_m": 1.5,
    "body.strands.linear_density_kg_per_m": 3.0,
    "body.strands.damping_time_s": 3.0,
    "body.springs.stiffness_N_per_m": 30.0,
    "body.mesh.radius_m": 2.0,
    "body.mesh.angular_rate_rad_per_m": 2.0,
    "body.rings.force": 5.0,
    "body.rings.length_range_m": 1.3,
    "body.pins.mass_kg": 3.0,
    "arena.contact_time_constant_s": 3.0,
    "sensor.tolerance_m": 3.0,
    "formulation.time_constant": 10.0,
}
"""Largest factor by which each field is multiplied or divided, log-uniformly."""
COLLAPSED, STRETCHED, DEEP, IDLE = 0.2, 4.0, 0.1, 1e-3
WORDS = {
    "ring": "has collapsed",
    "segment": "in the mesh at rest",
    "depth": "deep in the ground",
    "force": "pulled with no force",
    "flight": "-",
}
"""What a warning must say of each kind of nonsense."""


@dataclass
class Drawn:
    """A worm and how its run ended."""

    preset: str
    changes: dict[str, Any]
    arena: str | None
    end: str = ""
    message: str = ""
    warnings: tuple[str, ...] = ()
    nonsense: dict[str, str] = field(default_factory=dict)

    @property
    def silent(self) -> dict[str, str]:
        """The nonsense that nothing names."""
        if self.end in ("refused", "stopped"):
            return {}
        return {kind: what for kind, what in self.nonsense.items() if not any(WORDS[kind] in w for w in self.warnings)}


def draw(rng: np.random.Generator) -> Drawn:
    """Draws a worm: a preset, and some of its fields changed."""
    preset = str(rng.choice(PRESETS))
    base = load_config(preset)
    assert isinstance(base.body, WormBody)
    chosen = rng.choice(list(FACTORS), size=rng.integers(2, 9), replace=False)
    factors = {str(name): exp(rng.uniform(-1.0, 1.0) * log(FACTORS[str(name)])) for name in chosen}
    changes = _multiplied(base, factors)
    if rng.random() < 0.4:
        changes["body.mesh.n_helices"] = int(rng.choice([8, 12, 16, 20, 24]))
    if rng.random() < 0.5:
        changes["arena.friction"] = exp(rng.uniform(log(0.05), log(1.5)))
    if rng.random() < 0.3:
        changes["arena.gravity_m_per_s2"] = rng.uniform(0.0, 25.0)
    if rng.random() < 0.2:
        changes["body.springs.tension_only"] = True
    chain = isinstance(base.body.formulation, Chain)
    step = float(rng.choice([0.001, 0.002] if chain else [0.002, 0.005, 0.01, 0.02]))
    arena = str(rng.choice(ARENAS)) if rng.random() < 0.35 else None
    if arena is None and rng.random() < 0.25:
        changes["arena.slope_deg"] = rng.uniform(-35.0, 35.0)
    changes |= {
        "clock.physics_timestep_s": step,
        "record.signals_interval_s": step,
        "record.frames_interval_s": 0.02,
        "duration_s": 0.3 if chain else 0.5,
    }
    return Drawn(preset, changes, arena)


def _multiplied(base: RunConfig, factors: Mapping[str, float]) -> dict[str, Any]:
    tree: dict[str, Any] = base.model_dump()
    changes: dict[str, Any] = {}
    for name, factor in factors.items():
        path = name
        if name == "body.rings.force":
            path = f"body.rings.{'force_limit_N' if tree['body']['rings']['kind'] == 'servo' else 'peak_force_N'}"
        elif name == "formulation.time_constant":
            chain = tree["body"]["formulation"]["kind"] == "chain"
            path = f"body.formulation.{'pin' if chain else 'edge'}_time_constant_s"
        value: Any = tree
        for key in path.split("."):
            value = value[key]
        changes[path] = (np.array(value) * factor).tolist()
    return changes


def judge(data: xr.Dataset, config: RunConfig) -> dict[str, str]:
    """Tells from what a run recorded what is nonsense about it."""
    body, arena = config.body, config.arena
    assert isinstance(body, WormBody)
    assert arena is not None
    mesh, found = body.mesh, {}
    m = mesh.n_helices // 2
    place = data["crossing_position"].values
    ring = data["ring_length"].values.reshape(data.sizes["time"], mesh.n_segments, -1).sum(axis=2)
    shares = ring / (2.0 * mesh.one_number("radius_m") * np.sin(pi / m) * m)
    planes = mesh.free_planes_at_ends + mesh.planes_between_rings * np.arange(mesh.n_segments)
    by_plane = place.reshape(len(place), -1, m, 3)
    order = np.argsort(np.arctan2(*(by_plane[0, :, :, [2, 1]] - [[[mesh.one_number("radius_m")]], [[0.0]]])), axis=1)
    for plane in planes:
        corners = by_plane[:, plane][:, order[plane]]
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).sum(axis=1)
        shares = np.append(shares, sides / sides[0])
    if not shares.min() >= COLLAPSED:
        found["ring"] = f"a ring had {shares.min():.3f} of its length"
    centres = by_plane.mean(axis=2)
    spans = np.linalg.norm(centres[:, planes + 1] - centres[:, planes - 1], axis=2)
    if not (spans / spans[0]).max() <= STRETCHED:
        found["segment"] = f"a segment had {(spans / spans[0]).max():.2f} times its length"
    deep = _depth_m(place, config).max(initial=0.0)
    if not deep <= DEEP * mesh.one_number("radius_m"):
        found["depth"] = f"a crossing was {deep:.3f} m in the ground"
    if not np.abs(place - place[0]).max() <= 3.0:
        found["flight"] = "a crossing went over 3 m"
    idle = _idle(data, body)
    if idle:
        found["force"] = idle
    return found


def _depth_m(place: np.ndarray, config: RunConfig) -> np.ndarray:
    """Depth of crossings in the ground, m: of a pipe in its straight entry, of relief below its lowest place."""
    arena = config.arena
    assert isinstance(config.body, WormBody)
    if isinstance(arena, Pipe):
        away = np.linalg.norm(place[..., 1:] - [0.0, arena.bore_m], axis=-1)
        return (away - arena.bore_m - arena.entry_clearance_m)[place[..., 0] > 0.0]
    assert isinstance(arena, Ground)
    lowest = -arena.floor_gap_m - (4.0 * arena.roughness_m if isinstance(arena, Rough) else 0.0)
    return lowest - place[..., 2]


def _idle(data: xr.Dataset, body: WormBody) -> str:
    """Names a muscle without force throughout a contraction of 0.25 s and more."""
    n, rings = body.mesh.n_segments, body.rings
    greatest = rings.forces(n)
    time = data["time"].values
    for muscle in range(data.sizes["muscle"]):
        most = greatest[muscle * n // data.sizes["muscle"]]
        on = data["activation"].values[:, muscle] > 0.15
        edges = np.flatnonzero(np.diff(np.concatenate([[0], on, [0]])))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            force = data["muscle_force"].values[start:stop, muscle]
            if time[stop - 1] - time[start] >= 0.25 and not force.max() >= IDLE * most:
                return f"muscle {muscle} pulled {force.max():.2g} N from {time[start]:.2f} to {time[stop - 1]:.2f} s"
    return ""


def ended(worm: Drawn, folder: Path) -> Drawn:
    """Runs a worm and judges what it left."""
    try:
        config = load_config(worm.preset, worm.changes, arena=worm.arena)
        simulate(config, folder, progress=False)
    except ConfigError as refusal:
        worm.end, worm.message = "refused", str(refusal)
        return worm
    except SimulationStopped as stop:
        worm.end, worm.message = "stopped", str(stop)
    run = open_run(folder)
    worm.end, worm.warnings = worm.end or run.status, run.warnings
    worm.nonsense = judge(run.data, run.config)
    return worm


def told(worms: list[Drawn]) -> str:
    """Counts how worms ended."""
    ends = Counter(worm.end if worm.end != "complete" or not worm.warnings else "warned" for worm in worms)
    quiet = [worm for worm in worms if worm.end == "complete" and not worm.warnings]
    marked = Counter(f"{'nonsense' if worm.nonsense else 'plain'} {worm.end}" for worm in worms)
    lines = [f"{len(worms)} worms: {dict(ends)}; {len(quiet)} clean; judged here: {dict(marked)}"]
    for worm in worms:
        lines.append(f"{worm.preset} {worm.arena or ''}: {worm.end} {worm.message} {worm.nonsense or ''}")
        lines += [f"    {warning}" for warning in worm.warnings]
    return "\n".join(lines)


def test_the_first_cheap_random_worms_are_not_silent_nonsense(tmp_path: Path) -> None:
    rng = np.random.default_rng(SEED)
    drawn = [draw(rng) for _ in range(N_WORMS)]
    cheap = [worm for worm in drawn if worm.changes["clock.physics_timestep_s"] == 0.02][:5]
    worms = [ended(worm, tmp_path / str(number)) for number, worm in enumerate(cheap)]
    assert {number: worm.silent for number, worm in enumerate(worms) if worm.silent} == {}, told(worms)
    assert any(worm.end == "complete" for worm in worms)


@pytest.mark.slow
def test_no_random_worm_is_silent_nonsense(tmp_path: Path) -> None:
    rng = np.random.default_rng(SEED)
    worms = [ended(draw(rng), tmp_path / str(number)) for number in range(N_WORMS)]
    print(told(worms))
    assert {number: worm.silent for number, worm in enumerate(worms) if worm.silent} == {}
