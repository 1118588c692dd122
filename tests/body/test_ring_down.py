"""Strands of both formulations ring down as linear rod theory says: frequency and logarithmic decrement.

A cantilever of Kelvin-Voigt material, straight or along the worm's own helix, starts in the shape of a mode and rings
freely; two numbers are fitted to its decay. A mode of undamped angular frequency w has, at a material time tau, the
damping ratio w tau / 2 whatever its shape, since damping and stiffness are one operator but for tau. The undamped
frequencies come from the equations of a continuous, inextensible rod, solved by collocation.

``pytest -m slow -s tests/body/test_ring_down.py`` prints the errors over mesh and step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import pi, sqrt
from typing import Literal, cast

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eig

from annelid.body.constraint_rows import HELD
from annelid.body.formulations import BDF2_SHARE
from annelid.body.formulations.chain.capsules import add_chain
from annelid.body.mesh import Strands
from annelid.morphology import Array
from annelid.simulation import worm as _engine_warnings_go_to_the_log  # noqa: F401
from cantilevers import CLAMP_KG, RodCantilever

Motion = Literal["in plane", "across", "twist"]
Formulation = Literal["rods", "chain"]

RADIUS_M, RATE_RAD_PER_M = 0.16, 14.0
"""The worm's helix."""
LENGTH_M: dict[Motion, float] = {"in plane": 0.3, "across": 0.3, "twist": 0.06}
"""Twist rings in a shorter rod, where eight elements resolve the bending of its free end that comes with it."""
DAMPING_RATIO = 0.05
CONVERGED_STEP = 0.001
"""Angular frequency times step; an implicit step of first order adds half of it to the damping ratio."""
LONG_STEP = 0.1
"""Likewise, where a step of first order would double the damping; one of second order adds a quarter of its cube."""
DISPLACEMENT = 1e-4
"""Of the rod's length, or rad: small enough for linear theory."""
SAMPLES = 24
"""Of a ring-down, spread over a period where the step allows."""
MESHES, STEPS_S = (2, 3, 4, 6, 8), (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02)
FAST = {
    ("rods", "helix", "across"),
    ("rods", "straight", "twist"),
    ("chain", "helix", "in plane"),
    ("chain", "helix", "twist"),
}
STRANDS = Strands()
BENDING = STRANDS.one_number("young_modulus_Pa") * pi * STRANDS.radius_m**4 / 4
TORSION = STRANDS.one_number("shear_modulus_Pa") * pi * STRANDS.radius_m**4 / 2


@dataclass(frozen=True)
class Case:
    shape: Literal["straight", "helix"]
    motion: Motion

    @property
    def length_m(self) -> float:
        return LENGTH_M[self.motion]

    def __str__(self) -> str:
        return f"{self.shape} {self.motion}"

    def frequency(self) -> float:
        """Undamped angular frequency of the continuous rod, rad/s."""
        unit = sqrt(BENDING / STRANDS.one_number("linear_density_kg_per_m")) / self.length_m**2
        if self.shape == "straight":
            polar = STRANDS.one_number("linear_density_kg_per_m") * STRANDS.radius_m**2 / 2
            return pi / (2 * self.length_m) * sqrt(TORSION / polar) if self.motion == "twist" else 1.8751041**2 * unit
        square = 1.0 + (RADIUS_M * RATE_RAD_PER_M) ** 2
        curvature, torsion = RADIUS_M * RATE_RAD_PER_M**2 / square, RATE_RAD_PER_M / square
        frequencies, energies = rod_modes(curvature * self.length_m, torsion * self.length_m, self.length_m)
        if self.motion == "twist":
            return unit * frequencies[np.argmax(energies[2] > 0.5)]
        assert list(np.argmax(energies[:, :2], axis=0)) == [0, 1], "the modes are not in this order"
        return unit * frequencies[0 if self.motion == "in plane" else 1]

    def vertices(self, elements: int) -> Array:
        """Vertices about the clamp, which is the middle of the first edge, ``(elements + 2, 3)``."""
        arc = (np.arange(elements + 2, dtype=np.float64) - 0.5) * self.length_m / (elements + 0.5)
        if self.shape == "straight":
            return np.stack([arc, 0 * arc, 0 * arc], axis=-1)
        angle = arc * RATE_RAD_PER_M / sqrt(1.0 + (RADIUS_M * RATE_RAD_PER_M) ** 2)
        return np.stack([angle / RATE_RAD_PER_M, RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle)], axis=-1)


def rod_equations(curvature: float, torsion: float, gyration: float) -> tuple[Array, Array]:
    """Matrices of ``y' = (A + w^2 B) y`` for a helical rod, in units of its bending stiffness, mass and length.

    y holds displacement, rotation, force and moment along tangent, normal and binormal (Love 1927, chapter XXI).
    """

    def cross(vector: list[float]) -> Array:
        return np.cross(vector, np.eye(3)).T

    along = cross([1.0, 0.0, 0.0])
    a = np.kron(np.eye(4), -cross([torsion, 0.0, curvature])).astype(np.float64)
    a[0:3, 3:6] = a[9:12, 6:9] = -along
    a[3:6, 9:12] += np.diag([BENDING / TORSION, 1.0, 1.0])
    b = np.zeros((12, 12))
    b[6:9, 0:3] = -np.eye(3)
    b[9, 3] = -(gyration**2)
    return a, b


@cache
def rod_modes(curvature: float, torsion: float, length_m: float, order: int = 32) -> tuple[Array, Array]:
    """Undamped frequencies of a helical cantilever, and each mode's shares of kinetic energy.

    Returns:
        Frequencies in rising order, and shares of motion along the normal, along the binormal, and in twist.
    """
    gyration = STRANDS.radius_m / length_m / sqrt(2.0)
    a, b = rod_equations(curvature, torsion, gyration)
    # Chebyshev collocation (Trefethen 2000, chapter 6); the first node is the free end, the last the clamp.
    nodes = np.cos(pi * np.arange(order + 1) / order)
    weights = np.r_[2.0, np.ones(order - 1), 2.0] * (-1.0) ** np.arange(order + 1)
    derivative = np.outer(weights, 1.0 / weights) / (nodes[:, None] - nodes + np.eye(order + 1))
    derivative -= np.diag(derivative.sum(axis=1))
    left = np.kron(2.0 * derivative, np.eye(12)) - np.kron(np.eye(order + 1), a)
    right = np.kron(np.eye(order + 1), b)
    ends = np.r_[6:12, 12 * order : 12 * order + 6]
    left[ends], right[ends] = np.eye(12 * (order + 1))[ends], 0.0
    squares, modes = cast(tuple[Array, Array], eig(left, right))
    real = np.isfinite(squares) & (squares.real > 0) & (np.abs(squares.imag) < 1e-6 * np.abs(squares))
    rising = np.flatnonzero(real)[np.argsort(squares.real[real])]
    shapes = np.abs(modes.reshape(order + 1, 12, -1)[:, :, rising]) ** 2
    energy = np.einsum("n,nim->im", np.sqrt(1.0 - nodes**2), shapes[:, :4])
    energy[3] *= gyration**2
    return np.sqrt(squares.real[rising]), energy[1:4] / energy.sum(axis=0)


class Cantilever:
    """A cantilever that is put into a state and stepped; a state holds displacements, then velocities."""

    def __init__(self, formulation: str, case: Case, elements: int, damping_s: float, step_s: float) -> None:
        strands, vertices_m = Strands(damping_time_s=damping_s), case.vertices(elements)
        self.strains = self.two_step = None
        if formulation == "rods":
            rod = RodCantilever(vertices_m, strands, BDF2_SHARE * step_s)
            self.model, self.data, self.strains, self.two_step = rod.model, rod.data, rod.strains, rod.two_step
        else:
            spec = mujoco.MjSpec()
            spec.option.gravity = [0.0, 0.0, 0.0]
            spec.option.timestep = step_s
            spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
            add_chain(spec, "rod", vertices_m, strands, 0.0, root=0, fixed_root=True)
            self.model = spec.compile()
            self.data = mujoco.MjData(self.model)
        held = [self.model.joint(joint).name == HELD for joint in self.model.dof_jntid]
        self.free = (self.model.dof_M0 < CLAMP_KG) & ~np.array(held)

    def put(self, state: Array) -> None:
        """Displaces the rod from rest."""
        mujoco.mj_resetData(self.model, self.data)
        for target, part in zip((self.data.qpos, self.data.qvel), np.split(state, 2), strict=True):
            target[self.free] += part
        if self.strains is not None and self.two_step is not None:
            self.strains.place(self.model.qpos0, np.eye(3))
            self.strains.follow(self.data.qpos)
            self.two_step.rest()

    def step(self) -> Array:
        if self.two_step is None:
            mujoco.mj_step(self.model, self.data)
        else:
            self.two_step.step(lambda: None)
        return np.concatenate([(self.data.qpos - self.model.qpos0)[self.free], self.data.qvel[self.free]])

    def modes(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Rates and shapes of the linear map of one step, those that ring, in the order of their frequencies."""
        columns = []
        for unit in 1e-6 * np.eye(2 * self.free.sum()):
            self.put(unit)
            after = self.step()
            self.put(-unit)
            columns.append((after - self.step()) / 2e-6)
        factors, shapes = np.linalg.eig(np.array(columns).T)
        # Of BDF2 from rest the first step is the engine's.
        rates = np.log(factors.astype(complex)) / self.model.opt.timestep
        ringing = np.flatnonzero(rates.imag > 0)
        ringing = ringing[np.argsort(np.abs(rates[ringing]))]
        return rates[ringing], shapes[:, ringing]


@dataclass(frozen=True)
class Ring:
    """A cantilever of one formulation in one mode."""

    formulation: Formulation
    case: Case
    elements: int

    @property
    def frequency(self) -> float:
        """Undamped angular frequency, rad/s: the chain's elements end in hemispheres, which turn more easily."""
        if self.formulation != "chain" or self.case.motion != "twist":
            return self.case.frequency()
        length, radius = self.case.length_m / (self.elements + 0.5), STRANDS.radius_m
        return self.case.frequency() * sqrt((length + 4 / 3 * radius) / (length + 16 / 15 * radius))

    def cantilever(self, step_s: float) -> Cantilever:
        return Cantilever(self.formulation, self.case, self.elements, 2 * DAMPING_RATIO / self.frequency, step_s)

    def down(self, step_s: float) -> tuple[float, float] | None:
        """Errors of damped frequency and decrement, as parts of closed form; None for what is unstable or never rings.

        ``y[k + 2] = a y[k + 1] + b y[k]`` is fitted to the displacement along the shape that the rod starts in.
        """
        start, rod = mode_shape(self), self.cantilever(step_s)
        rod.put(start)
        damped = sqrt(1 - DAMPING_RATIO**2)
        period_s = 2 * pi / (self.frequency * damped)
        stride = max(1, round(period_s / SAMPLES / step_s))
        decay, half = np.empty(SAMPLES), len(start) // 2
        for sample in range(SAMPLES):
            for _ in range(stride - 1):
                rod.step()
            decay[sample] = rod.step()[:half] @ start[:half]
        if not np.isfinite(decay).all() or rod.data.warning.number.any():
            return None
        (a, b), *_ = np.linalg.lstsq(np.stack([decay[1:-1], decay[:-2]], axis=-1), decay[2:], rcond=None)
        rate = np.log(complex(a, sqrt(max(-a * a - 4 * b, 0.0))) / 2) / (stride * step_s)
        if rate.imag <= 0 or rate.real >= 0:
            return None
        return rate.imag / (self.frequency * damped) - 1, -rate.real / rate.imag / DAMPING_RATIO * damped - 1


@cache
def mode_shape(ring: Ring) -> Array:
    """State from which the rod rings in one mode, scaled to a small displacement; found at a converged step."""
    rates, shapes = ring.cantilever(CONVERGED_STEP / ring.frequency).modes()
    nearest = int(np.argmin(np.abs(np.abs(rates) - ring.frequency)))
    shape = shapes[:, {"in plane": 0, "across": 1, "twist": nearest}[ring.case.motion]]
    half = len(shape) // 2
    # The phase at which displacements are at their largest.
    turned = (shape / np.sqrt((shape[:half] ** 2).sum())).real
    scale = ring.case.length_m if ring.case.motion != "twist" else 1.0
    return DISPLACEMENT * scale / np.abs(turned[:half]).max() * turned


def test_the_equations_of_a_curved_rod_hold_the_closed_forms_of_a_ring() -> None:
    """Hoppe's (1871) flexure of a ring in its plane, and Michell's (1890) across it."""
    for waves in (2, 3, 5):
        lobes = (waves * (waves**2 - 1)) ** 2
        a, b = rod_equations(1.0, 0.0, 0.0)
        for square in (lobes / (waves**2 + 1), lobes / (waves**2 + BENDING / TORSION)):
            matrix = a + square * b - 1j * waves * np.eye(12)
            assert np.linalg.svd(matrix, compute_uv=False)[-1] < 1e-12


def test_the_equations_of_a_straight_rod_hold_those_of_a_cantilever() -> None:
    frequencies, shares = rod_modes(0.0, 0.0, 0.06)
    unit = sqrt(BENDING / STRANDS.one_number("linear_density_kg_per_m")) / 0.06**2
    assert unit * frequencies[:2] == pytest.approx(Case("straight", "across").frequency() * 25, rel=1e-6)
    twist = unit * frequencies[np.argmax(shares[2] > 0.5)]
    assert twist == pytest.approx(Case("straight", "twist").frequency(), rel=1e-6)


CASES = [Case(shape, motion) for shape in ("straight", "helix") for motion in LENGTH_M]


@pytest.mark.parametrize(
    ("formulation", "case"),
    [
        pytest.param(formulation, case, id=f"{formulation} {case}", marks=slow)
        for formulation in ("rods", "chain")
        for case in CASES
        for slow in [[] if (formulation, case.shape, case.motion) in FAST else [pytest.mark.slow]]
    ],
)
def test_a_cantilever_rings_down_as_rod_theory_says(formulation: Formulation, case: Case) -> None:
    ring = Ring(formulation, case, 8)
    errors = ring.down(CONVERGED_STEP / ring.frequency)
    assert errors is not None
    print(f"{formulation} {case}: frequency {errors[0]:+.2%}, decrement {errors[1]:+.2%}")
    assert abs(errors[0]) < 0.01
    assert abs(errors[1]) < 0.05


@pytest.mark.parametrize("case", [case for case in CASES if case.shape == "helix"], ids=str)
def test_a_cantilever_of_rods_does_so_at_steps_that_would_double_its_damping_otherwise(case: Case) -> None:
    errors = Ring("rods", case, 8).down(LONG_STEP / case.frequency())
    assert errors is not None
    print(f"{case}: frequency {errors[0]:+.2%}, decrement {errors[1]:+.2%}")
    assert abs(errors[0]) < 0.02
    assert abs(errors[1]) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=str)
@pytest.mark.parametrize("formulation", ["rods", "chain"])
def test_errors_fall_with_the_mesh_and_with_the_step(formulation: Formulation, case: Case) -> None:
    """Prints the errors of frequency and decrement; a dash where the motion is overdamped or unstable."""
    # The shortest is converged for every mesh.
    steps_s = [CONVERGED_STEP / case.frequency(), *STEPS_S]
    print(f"\n{formulation}, {case}, {case.frequency():.6g} rad/s; steps in ms:")
    print("elements", *(f"{1e3 * step:17.3g}" for step in steps_s))
    table = []
    for elements in MESHES:
        table.append([Ring(formulation, case, elements).down(step) for step in steps_s])
        print(f"{elements:8d}", *(f"{e[0]:+8.1%} {e[1]:+8.1%}" if e else f"{'-':>17}" for e in table[-1]))
    coarsest, finest = table[0], table[-1]
    assert coarsest[0] is not None
    assert finest[0] is not None
    order = np.log(coarsest[0][0] / finest[0][0]) / np.log((MESHES[-1] + 0.5) / (MESHES[0] + 0.5))
    print(f"order of the frequency in the element's length: {order:.2f}")
    assert order > 1.5
