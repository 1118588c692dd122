"""Coils of shape-memory wire round each ring: a current heats them, the air cools them.

A coil is a spring that is stiffer the more of it is austenite. With a share x of austenite and a length L, L0 when its
turns touch, so that it has L0 / d of them, it pulls with

    F = (G_M + x (G_A - G_M)) d^2 / (8 C^3) (L / L0 - 1)

with the wire's diameter d, the coil's diameter over it C, and the shear moduli of martensite and austenite. The wire
has one temperature T. A share a of the time it carries the current I:

    (rho c pi d^2 / 4) dT/dt = a I^2 r / (pi d^2 / 4) - h pi d (T - T_air)

with density rho, specific heat c, resistivity r and the heat transfer h to the air. While it is heated from A_s to A_f,
what is left of the martensite falls as ``1 + cos(pi (T - A_s) / (A_f - A_s))``, and while it cools from M_s to M_f the
austenite falls as ``1 + cos(pi (M_s - T) / (M_s - M_f))`` (Liang and Rogers 1990). Stress shifts none of these
temperatures here, the transformation takes no heat, and martensite does not stretch for good.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, exp, pi
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.body.actuators import ActuatorKind, PerSegment, Slopes
from annelid.body.estimates import bearable_force_N, crush_findings, rhombus_of, weakness_findings
from annelid.body.mesh import MeshBody
from annelid.config.answers import Finding
from annelid.config.sections import Modulus, Positive
from annelid.morphology import Array

if TYPE_CHECKING:
    import mujoco

Temperature = Annotated[float, Field(ge=-200, le=1000)]


class CoilRings(ActuatorKind):
    """Coils of shape-memory wire that contract while a current heats them, and are stretched again as they cool.

    Activation is the share of the time in which the current flows. A length range begins with the length at which a
    coil's turns touch, below which it pulls nothing; its end is the longest that a coil is meant for. The engine has
    two states of each coil: its temperature, in degrees Celsius, and its share of austenite.
    """

    cites: ClassVar[tuple[tuple[str, str], ...]] = (
        ("liang1990", "the transformation of the coils"),
        ("seok2013", "coils of shape-memory wire round a mesh"),
        ("smainc", "the wire's properties"),
        ("dynalloy", "the wire's properties"),
    )
    force_field: ClassVar[str] = "coils"
    kind: Literal["coil"] = "coil"
    coils: PerSegment = Field(default=1.0, description="coils side by side, one number for all or one per segment")
    wire_diameter_m: Positive = Field(default=0.0005, description="diameter of the wire")
    spring_index: Annotated[float, Field(ge=2, le=100)] = Field(
        default=6.0, description="diameter of a coil, to the middle of its wire, over that of the wire"
    )
    shear_moduli_Pa: tuple[Modulus, Modulus] = Field(
        default=(10.5e9, 31.2e9), description="shear moduli of martensite and of austenite"
    )
    current_A: Positive = Field(default=2.0, description="current at activation 1")
    resistivity_Ohm_m: Positive = Field(default=0.9e-6, description="electrical resistivity of the wire")
    density_kg_per_m3: Positive = Field(default=6450.0, description="density of the wire")
    specific_heat_J_per_kgK: Positive = Field(default=837.0, description="specific heat of the wire")
    heat_transfer_W_per_m2K: Positive = Field(default=60.0, description="heat that the air takes from the wire")
    air_C: Temperature = Field(default=20.0, description="temperature of the air, and of the coils at the start")
    austenite_C: tuple[Temperature, Temperature] = Field(
        default=(70.0, 80.0), description="start and finish of the transformation to austenite, heated"
    )
    martensite_C: tuple[Temperature, Temperature] = Field(
        default=(40.0, 30.0), description="start and finish of the transformation to martensite, cooled"
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        (a_start, a_finish), (m_start, m_finish) = self.austenite_C, self.martensite_C
        if not (a_start < a_finish and m_finish < m_start < a_finish and m_finish < a_start):
            raise ValueError(
                f"body.rings.austenite_C = [{a_start:g}, {a_finish:g}] and body.rings.martensite_C = [{m_start:g}, "
                f"{m_finish:g}] are no loop: austenite must start below where it finishes, martensite above where it "
                "finishes, and each of both must be lower for martensite"
            )
        if self.air_C >= m_finish:
            raise ValueError(
                f"body.rings.air_C = {self.air_C:g}: must be below {m_finish:g}, where body.rings.martensite_C "
                "finishes; a coil would never be soft again"
            )
        if self.shear_moduli_Pa[0] > self.shear_moduli_Pa[1]:
            raise ValueError("body.rings.shear_moduli_Pa: martensite comes first and must be the softer one")
        return self

    @property
    def cooling_time_s(self) -> float:
        """Time in which what a coil is warmer than the air falls to 1/e, s."""
        heat = self.density_kg_per_m3 * self.specific_heat_J_per_kgK * self.wire_diameter_m
        return heat / (4.0 * self.heat_transfer_W_per_m2K)

    @property
    def warming_K(self) -> float:
        """How much warmer than the air a coil becomes at activation 1, K."""
        ohmic = 4.0 * self.current_A**2 * self.resistivity_Ohm_m
        return ohmic / (pi**2 * self.heat_transfer_W_per_m2K * self.wire_diameter_m**3)

    def forces(self, n_segments: int) -> list[float]:
        """Returns the forces of every segment's coils, hot and at their greatest length, N."""
        one_N = self.shear_moduli_Pa[1] * self.wire_diameter_m**2 / (8.0 * self.spring_index**3)
        spans, coils = self.length_ranges(n_segments), self.of_each("coils", n_segments)
        return [n * one_N * (high / low - 1.0) for n, (low, high) in zip(coils, spans, strict=True)]

    def findings(self, body: MeshBody) -> Iterator[Finding]:
        """Checks lengths and forces against the mesh, and the heat against the transformation."""
        hottest, (_, finish) = self.air_C + self.warming_K, self.austenite_C
        if hottest <= finish:
            problem = f"coils become {hottest:.3g} C warm, and body.rings.austenite_C finishes at {finish:g} C"
            enough = self.current_A * ((finish - self.air_C) / self.warming_K) ** 0.5
            yield Finding("body.rings.current_A", self.current_A, problem, f"set at least {1.1 * enough:.2g}")
        rest, bearable = rhombus_of(body).ring_length_m, bearable_force_N(body)
        coils = max(self.of_each("coils", body.n_segments))
        for low, high, force_N in self.strongest(body.n_segments):
            hot = force_N * max(0.0, rest - low) / (high - low)
            cold = hot * self.shear_moduli_Pa[0] / self.shear_moduli_Pa[1]
            field, fitting = "body.rings.length_range_m", f"set [{0.4 * rest:.3g}, {rest:.3g}]"
            if low >= rest:
                problem = f"a ring is {rest:.3g} m long at rest, where a coil of {low:.3g} m pulls 0 N"
                yield Finding(field, [low, high], problem, fitting, "error")
                continue
            if high < 0.98 * rest:
                problem = f"a ring is {rest:.3g} m long at rest, longer than its coil is meant for"
                yield Finding(field, [low, high], problem, fitting)
            if cold > bearable:
                problem = f"cold coils pull a ring at rest with {cold:.2g} N, where the mesh bears {bearable:.2g} N"
                yield Finding("body.rings.coils", coils, problem, f"set at most {coils * bearable / cold:.2g}")
            yield from weakness_findings(body, "coils", coils, hot)
            yield from crush_findings("coils", hot, bearable, low / rest)

    def add(self, spec: mujoco.MjSpec, name: str, span_m: list[float], force_N: float) -> None:
        """Adds a coil whose force is linear in its length and in its share of austenite, its last state."""
        import mujoco

        soft, stiff = (force_N / (span_m[1] - span_m[0]) * g / self.shear_moduli_Pa[1] for g in self.shear_moduli_Pa)
        added = stiff - soft
        spec.add_actuator(
            name=name,
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_TENDON,
            dyntype=mujoco.mjtDyn.mjDYN_USER,
            actdim=2,
            gaintype=mujoco.mjtGain.mjGAIN_AFFINE,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            gainprm=[added * span_m[0], -added, *[0.0] * 8],
            biasprm=[soft * span_m[0], -soft, *[0.0] * 8],
            lengthrange=span_m,
            ctrllimited=True,
            ctrlrange=[0.0, 1.0],
            forcelimited=True,
            forcerange=[-1e6, 0.0],
        )

    def slopes(self, model: mujoco.MjModel) -> Slopes:
        """Returns the stiffness of coils that pull."""
        soft, added = -model.actuator_biasprm[:, 1].copy(), -model.actuator_gainprm[:, 1].copy()

        def slopes(length_m: Array, rate_m_per_s: Array, drive: Array, tension_N: Array) -> tuple[Array, Array]:
            return (soft + drive * added) * (tension_N > 0.0), np.zeros_like(length_m)

        return slopes

    def first_act(self, model: mujoco.MjModel) -> Array:
        """Returns cold coils."""
        return self._cold(model.nu)

    def act_at_rest(self, spec: mujoco.MjSpec) -> Array:
        """Returns cold coils."""
        return self._cold(len(spec.actuators))

    def _cold(self, n: int) -> Array:
        return np.tile([self.air_C, 0.0], n)

    def drive(self, activation: Array, state: Array) -> Array:
        """Returns the shares of austenite."""
        return state[1::2].copy()

    def states_after(
        self, model: mujoco.MjModel, activation: Array, state: Array, length_m: Array, time_s: float
    ) -> Array:
        """Returns temperatures and shares of austenite after commands, solved exactly."""
        left = exp(-time_s / self.cooling_time_s)
        after = list[float]()
        # A few coils at a time: plain numbers are faster than arrays.
        for (warm, share), commands in zip(state.reshape(-1, 2).tolist(), activation.T.tolist(), strict=True):
            for command in commands:
                steady = self.air_C + command * self.warming_K
                before, warm = warm, steady + left * (warm - steady)
                if warm > before:
                    share = 1.0 - (1.0 - share) * _kept(before, warm, *self.austenite_C)
                else:
                    share *= _kept(before, warm, *self.martensite_C)
            after += [warm, share]
        return np.array(after)


def _kept(before: float, after: float, start: float, finish: float) -> float:
    """Share that is kept of a phase which transforms from one temperature to another, between two of them."""
    had, has = (1.0 + cos(pi * min(max((one - start) / (finish - start), 0.0), 1.0)) for one in (before, after))
    return has / had if had else 0.0
