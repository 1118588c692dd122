"""What a run and a measured log agree in, as a table, as a figure, and as plots of the live view."""

from __future__ import annotations

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING

from annelid.draw import UNKNOWN, canvas, framed_table, panel_title, save_both
from annelid.live import Curve, Plot
from annelid_lab.logs.agreement import Agreement

if TYPE_CHECKING:
    from rich.table import Table


def agreement_table(found: Agreement) -> Table:
    """Returns a run's agreement with a measured log, two lines for each signal: measured and simulated."""
    periods = [UNKNOWN if isnan(one) else f"{one:.3f} s" for one in found.period_s]
    caption = f"lag {found.lag_s:.3f} s, clock drift {100 * found.clock_drift:.2f} %"
    table = framed_table("signal", "amplitude", "duty", "period", "rms error", "phase", "waveform", caption=caption)
    table.columns[0].no_wrap = True
    for name, one in found.signals.items():
        scale, unit = (1e3, "mm") if one.unit == "m" else (1.0, one.unit)
        share = UNKNOWN if isnan(one.relative) else f"{100 * one.relative:.0f} %"
        table.add_row(
            f"{name}\n{one.signal}",
            "\n".join(f"{scale * size:.3g} {unit}" for size in one.amplitude),
            "\n".join(f"{100 * high:.0f} %" for high in one.duty),
            "\n".join(periods),
            f"{scale * one.rms:.3g} {unit}\n{share}",
            UNKNOWN if isnan(one.phase) else f"{one.phase:+.2f}",
            UNKNOWN if isnan(one.waveform) else f"{one.waveform:.2f}",
        )
    return table


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
