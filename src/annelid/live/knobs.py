"""What can be turned while a worm runs: fields of its configuration, with the ranges of their sliders."""

from __future__ import annotations

from annelid.body.worm import WormBody
from annelid.config import Knob, RunConfig

_LEAST_FRICTION = 0.01


def knobs_of(config: RunConfig) -> tuple[Knob, ...]:
    """Returns what can be turned of a 3D worm; sensors and drive only where its controller uses them."""
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
    if "tolerance_m" in controller.sensor_fields:
        most = _above(1e3 * sensor.tolerance_m, 40.0)
        near = "A stretch sensor is on while its segment is within this of its rest length."
        knobs.append(Knob("sensor.tolerance_m", "sensor tolerance (mm)", 1e3, 0.0, most, 0.5, near))
    if "noise_m" in controller.sensor_fields:
        most = _above(1e3 * sensor.noise_m, 10.0)
        noise = "Standard deviation of the noise on every reading of a stretch sensor."
        knobs.append(Knob("sensor.noise_m", "sensor noise (mm)", 1e3, 0.0, most, 0.1, noise))
    return (*knobs, *controller.knobs())


def _above(value: float, usual: float) -> float:
    """The usual upper end of a range, or one well above a value beyond it."""
    return usual if value <= usual else _round(2.0 * value)


def _round(value: float) -> float:
    """Two digits of a number, so that sliders end at round ones."""
    return float(f"{value:.2g}")
