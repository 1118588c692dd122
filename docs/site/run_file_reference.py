"""The reference of the run file, made from what the worms and their controllers record."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from annelid.config import ControllerKind, kinds_of, load_config
from annelid.protocols import Records, Signal
from annelid.simulation import build_controller, build_plant
from annelid.simulation.recorder import loop_signals

BODIES = {
    "riddle2023-rods": "rods",
    "riddle2023": "chain",
    "riddle2025": "servos",
    "riddle2022-planar": "riddle2022",
    "daltorio2013": "daltorio2013",
    "boxerbaum2012": "boxerbaum2012",
}
"""Presets of all kinds of bodies, and what the page calls these."""
HALF_RINGS = "riddle2025-3x1"
WITH_ALL_SIGNALS = {
    "program": {"contractions": [{"segment": 1, "start_s": 0.0, "stop_s": 1.0}]},
    "policy": {"hidden": [[0.0] * 9], "hidden_bias": [0.0], "output": [[0.0]] * 3, "output_bias": [0.0] * 3},
    "sns-robust": {"motor_time_constant_s": 0.35, "descending": {"lift": 0.45}},
}
"""What kinds of controllers must be given, or record more with."""


def page() -> str:
    """Returns the page below its introduction: every variable with dimensions, unit, meaning, and who records it."""
    bodies: dict[str, list[str]] = {}
    controllers: dict[str, list[str]] = {}
    signals: dict[str, Signal] = {}
    for who, signal in _of_bodies():
        signals.setdefault(signal.name, signal)
        bodies.setdefault(signal.name, []).append(who)
    for who, signal in _of_controllers():
        signals.setdefault(signal.name, signal)
        controllers.setdefault(signal.name, []).append(who)
    loop = {signal.name: signal for signal in loop_signals(3).signals}
    lines = ["## In every run", *_table(loop, {})]
    lines += ["", "## Recorded by the body", *_table({name: signals[name] for name in bodies}, bodies, len(BODIES))]
    lines += ["", "## Recorded by the controller", *_table({name: signals[name] for name in controllers}, controllers)]
    return "\n".join(lines) + "\n"


def _table(signals: dict[str, Signal], who: dict[str, list[str]], everyone: int = 0) -> list[str]:
    last = " recorded by |" if who else ""
    lines = ["", f"| variable | dimensions | unit | what it is |{last}", f"|---|---|---|---|{'---|' if who else ''}"]
    for name, signal in signals.items():
        dims = ", ".join(("frame" if signal.every_frame else "time", *signal.dims))
        whose = "all" if len(who.get(name, ())) == everyone else ", ".join(who.get(name, ()))
        cells = [f"`{name}`", dims, signal.units, signal.long_name, *([whose] if who else [])]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _of_bodies() -> Iterator[tuple[str, Signal]]:
    for preset, kind in BODIES.items():
        yield from ((kind, signal) for signal in _signals(build_plant(load_config(preset))))


def _of_controllers() -> Iterator[tuple[str, Signal]]:
    """Controllers of every kind on one body each, then what turning adds."""
    base = load_config("riddle2023-rods")
    plant = build_plant(base)
    for kind in kinds_of(ControllerKind):
        controller = {"kind": kind, **WITH_ALL_SIGNALS.get(kind, {})}
        config = load_config("riddle2023-rods", {"controller": controller})
        yield from ((kind, signal) for signal in _signals(build_controller(config, plant)))
    turning = load_config(HALF_RINGS, {"turning.kind": "constant"})
    halves = build_plant(turning)
    seen = {signal.name for signal in _signals(build_controller(turning.model_copy(update={"turning": None}), halves))}
    for signal in _signals(build_controller(turning, halves)):
        if signal.name not in seen:
            yield "turning", signal


def _signals(part: Any) -> tuple[Signal, ...]:
    return part.recordable().signals if isinstance(part, Records) else ()
