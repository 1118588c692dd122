"""What can be turned while a worm runs: fields of its configuration, with the ranges of their sliders."""

from __future__ import annotations

from dataclasses import dataclass

from annelid.config import (
    AdaptiveSns,
    PhaseChain,
    PressureSns,
    RobustSns,
    RunConfig,
    SnsController,
    WormBody,
    field_value,
)

_LEAST_FRICTION = 0.01


@dataclass(frozen=True)
class Knob:
    """One number that can be turned.

    Attributes:
        field: Dotted path in the configuration.
        label: What it is, with the unit that is shown.
        scale: What is shown over the value in the field's own unit.
        low: Least that is shown.
        high: Most that is shown.
        step: Between two values that are shown.
        hint: What turning it does.
    """

    field: str
    label: str
    scale: float
    low: float
    high: float
    step: float
    hint: str

    def shown(self, config: RunConfig) -> float:
        """Returns the value that a configuration has, as it is shown."""
        value = field_value(config, self.field)
        # Without the last bits, which a change of units adds and a slider would print.
        return min(max(float(f"{self.scale * float(value):.10g}"), self.low), self.high)

    def value(self, shown: float) -> float:
        """Returns the field's value for one that is shown."""
        return float(f"{shown / self.scale:.10g}")


def knobs_of(config: RunConfig) -> tuple[Knob, ...]:
    """Returns what can be turned of a 3D worm; sensors and drive only where its controller has them."""
    body, arena, controller, sensor = config.body, config.arena, config.controller, config.sensor
    assert isinstance(body, WormBody)
    assert arena is not None
    friction, strands, springs = "arena.friction", "body.strands.young_modulus_Pa", "body.springs.stiffness_N_per_m"
    gpa, stiffness = 1e-9 * body.strands.young_modulus_Pa, body.springs.stiffness_N_per_m
    sliding = f"Sliding friction of skin and ground ({'forwards' if arena.has_setae else 'any direction'}). "
    rebuilt = "The body is rebuilt and goes on where it is."
    bending = f"Young's modulus of the strands, which resists bending. {rebuilt}"
    axial = f"Stiffness of the axial springs. {rebuilt}"
    most = _above(arena.friction, 2.0)
    knobs = [
        Knob(friction, "friction", 1.0, _LEAST_FRICTION, most, 0.01, sliding + "Takes effect in the next step."),
        Knob(strands, "strands (GPa)", 1e-9, _round(gpa / 4), _round(4 * gpa), _round(gpa / 40), bending),
        Knob(springs, "springs (N/m)", 1.0, 0.0, _round(4 * stiffness) or 100.0, 0.1, axial),
    ]
    if isinstance(controller, SnsController | AdaptiveSns | PressureSns):
        most = _above(1e3 * sensor.tolerance_m, 40.0)
        near = "A stretch sensor is on while its segment is within this of its rest length."
        knobs.append(Knob("sensor.tolerance_m", "sensor tolerance (mm)", 1e3, 0.0, most, 0.5, near))
    if isinstance(controller, SnsController | AdaptiveSns | PressureSns | RobustSns):
        most = _above(1e3 * sensor.noise_m, 10.0)
        noise = "Standard deviation of the noise on every reading of a stretch sensor."
        knobs.append(Knob("sensor.noise_m", "sensor noise (mm)", 1e3, 0.0, most, 0.1, noise))
    descending = "Descending drive: more of it makes the wave faster."
    if isinstance(controller, AdaptiveSns):
        knobs.append(Knob("controller.drive", "drive", 1.0, 0.0, 1.0, 0.01, descending))
    elif isinstance(controller, RobustSns) and controller.descending.lift:
        knobs.append(Knob("controller.descending.drive", "drive", 1.0, 0.0, 1.0, 0.01, descending))
    elif isinstance(controller, PhaseChain):
        knobs.append(Knob("controller.drive", "drive", 1.0, 0.0, 6.0, 0.05, descending))
    return tuple(knobs)


def _above(value: float, usual: float) -> float:
    """The usual upper end of a range, or one well above a value beyond it."""
    return usual if value <= usual else _round(2.0 * value)


def _round(value: float) -> float:
    """Two digits of a number, so that sliders end at round ones."""
    return float(f"{value:.2g}")
