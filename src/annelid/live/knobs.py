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
    body, arena, controller = config.body, config.arena, config.controller
    assert isinstance(body, WormBody)
    assert arena is not None
    sliding = "forwards" if arena.has_setae else "any direction"
    friction = _above(arena.friction, 2.0)
    strands, springs = 1e-9 * body.strands.young_modulus_Pa, body.springs.stiffness_N_per_m
    knobs = [
        Knob(
            "arena.friction",
            "friction",
            1.0,
            _LEAST_FRICTION,
            friction,
            0.01,
            f"Sliding friction of skin and ground ({sliding}). Takes effect in the next step.",
        ),
        Knob(
            "body.strands.young_modulus_Pa",
            "strands (GPa)",
            1e-9,
            _round(strands / 4),
            _round(4 * strands),
            _round(strands / 40),
            "Young's modulus of the strands, which resists bending. The body is rebuilt and goes on where it is.",
        ),
        Knob(
            "body.springs.stiffness_N_per_m",
            "springs (N/m)",
            1.0,
            0.0,
            _round(4 * springs) or 100.0,
            0.1,
            "Stiffness of the axial springs. The body is rebuilt and goes on where it is.",
        ),
    ]
    if isinstance(controller, SnsController | AdaptiveSns | PressureSns):
        knobs.append(
            Knob(
                "sensor.tolerance_m",
                "sensor tolerance (mm)",
                1e3,
                0.0,
                _above(1e3 * config.sensor.tolerance_m, 40.0),
                0.5,
                "A stretch sensor is on while its segment is within this of its rest length.",
            )
        )
    if isinstance(controller, SnsController | AdaptiveSns | PressureSns | RobustSns):
        knobs.append(
            Knob(
                "sensor.noise_m",
                "sensor noise (mm)",
                1e3,
                0.0,
                _above(1e3 * config.sensor.noise_m, 10.0),
                0.1,
                "Standard deviation of the noise on every reading of a stretch sensor.",
            )
        )
    return (*knobs, *_drive(config))


def _drive(config: RunConfig) -> tuple[Knob, ...]:
    controller = config.controller
    hint = "Descending drive: more of it makes the wave faster."
    if isinstance(controller, AdaptiveSns):
        return (Knob("controller.drive", "drive", 1.0, 0.0, 1.0, 0.01, hint),)
    if isinstance(controller, RobustSns) and controller.descending.lift:
        return (Knob("controller.descending.drive", "drive", 1.0, 0.0, 1.0, 0.01, hint),)
    if isinstance(controller, PhaseChain):
        return (Knob("controller.drive", "drive", 1.0, 0.0, 6.0, 0.05, hint),)
    return ()


def _above(value: float, usual: float) -> float:
    """The usual upper end of a range, or one well above a value beyond it."""
    return usual if value <= usual else _round(2.0 * value)


def _round(value: float) -> float:
    """Two digits of a number, so that sliders end at round ones."""
    return float(f"{value:.2g}")
