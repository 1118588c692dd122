"""What a run and a measured log agree in, as a table, as a figure, and as plots of the live view."""

from __future__ import annotations

from math import isnan
from pathlib import Path

from annelid.analysis import three_digits
from annelid.draw import UNKNOWN, aligned, canvas, panel_title, save_both
from annelid.live import Curve, Plot
from annelid_lab.logs.agreement import Agreement


def agreement_table(found: Agreement) -> str:
    """Returns a run's agreement with a measured log, two lines for each signal: measured, and simulated below it."""
    rows: list[tuple[str, ...]] = [("signal", "amplitude", "duty", "period", "rms error", "phase", "waveform")]
    for name, one in found.signals.items():
        scale, unit = (1e3, "mm") if one.unit == "m" else (1.0, one.unit)
        share = UNKNOWN if isnan(one.relative) else f"{100 * one.relative:.0f} %"
        likeness = (f"{each:{form}}" for each, form in ((one.phase, "+.2f"), (one.waveform, ".2f")))
        errors = (f"{three_digits(scale * one.rms)} {unit}", *(UNKNOWN if "nan" in each else each for each in likeness))
        both = zip((name, one.signal), one.amplitude, one.duty, found.period_s, (errors, (share,)), strict=True)
        for label, size, high, period_s, behind in both:
            period = UNKNOWN if isnan(period_s) else f"{three_digits(period_s)} s"
            rows.append((label, f"{three_digits(scale * size)} {unit}", f"{100 * high:.0f} %", period, *behind))
    lag = f"lag {three_digits(found.lag_s)} s, clock drift {100 * found.clock_drift:.2f} %"
    below = "measured, simulated below it; below an error, its share of the amplitude"
    return f"{aligned(rows)}\n{below}\n{lag}"


def agreement_figure(found: Agreement, stem: Path) -> Path:
    """Draws each measured signal over the simulated one, as ``.svg`` and ``.png``; returns the path of the latter."""
    with canvas(0.7 + 1.25 * len(found.signals)) as figure:
        panels = figure.subplots(len(found.signals), sharex=True, squeeze=False)[:, 0]
        for axes, (name, one) in zip(panels, found.signals.items(), strict=True):
            scale, unit = (100.0, "cm") if one.unit == "m" else (1.0, one.unit)
            panel_title(axes, f"{name}: {one.signal}, rms {scale * one.rms:.2g} {unit}")
            axes.set_ylabel(unit)
            axes.plot(found.time_s, scale * found.measured[name], color="0.55", linewidth=2.6, label="measured")
            axes.plot(found.time_s, scale * found.simulated[name], color="#1b2a6b", linewidth=1.2, label="simulated")
        panels[-1].set_xlabel("time of the run (s)")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
        return save_both(figure, stem)


def measured_plots(agreement: Agreement) -> dict[str, Plot]:
    """Returns a plot for each column of a measured log: the log, dashed, and the run that it was aligned with."""
    plots: dict[str, Plot] = {}
    for name, one in agreement.signals.items():
        curves = Curve("", "simulated", 0), Curve("", "measured", 1, dashed=True)
        series = agreement.time_s, agreement.simulated[name], agreement.measured[name]
        plots[f"measured: {name}"] = Plot(f"{one.signal} ({one.unit}), measured dashed", curves, 2, series=series)
    return plots
