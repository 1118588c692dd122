"""The panel beside the scene: what is played, what can be turned, plots of signals, and what the colours mean."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.config import Knob, RunConfig
from annelid.draw.canvas import CONTRACTED, RELAXED, segment_colors
from annelid.draw.figures.network_diagram import by_segment, network_of, role_of
from annelid.live.lines_and_arrows import CONTACT_COLOR, SPRING_COLORS, SPRING_RANGE, STRAND_COLORS
from annelid.live.live_worm import LiveWorm, knobs_of
from annelid.live.network import colors_html, network_html
from annelid.live.player import FASTEST, SLOWEST, Player
from annelid.live.requests import Requests
from annelid.live.scene_nodes import LAYERS, Stage
from annelid.morphology import Array

if TYPE_CHECKING:
    import viser


PLAY, NOW, AGAIN = "Play / pause", "Live", "Restart"
STRONGEST_POKE = 1.5  # in weights of the worm; more would tear it
PLOT_HEIGHT = 190  # of the plots, pixels
MOST_SEGMENTS = 4  # with more than these the expansion neurons are left out of the first plot
MOST_NEURONS = 24  # with more than these the diagram is folded at first
SECONDS = 5.0  # how far back the plots go, in simulated time
MOST_SAMPLES = 250  # of one curve of a plot


@dataclass(frozen=True)
class Curve:
    """One signal of a plot."""

    signal: str  # its name in the history
    label: str
    number: int  # its place among the plot's colours
    dashed: bool = False


@dataclass(frozen=True)
class Plot:
    """Curves that are drawn together."""

    title: str  # what they are, with the unit
    curves: tuple[Curve, ...]
    n_colors: int
    limits: tuple[float, float] | None = None  # ends of the axis, or None for those of the curves
    series: tuple[Array, ...] = ()  # times and the curves' values, where these are not signals of the history

    def window(self, first_s: float, last_s: float) -> tuple[Array, ...]:
        """Returns times and values of its `series` in a stretch of time, thinned."""
        start, stop = np.searchsorted(self.series[0], (first_s, last_s))
        every = max(1, -(-int(stop - start) // MOST_SAMPLES))
        return tuple(one[start + -start % every : stop : every] for one in self.series)


def neurons_of(names: Sequence[str]) -> Sequence[str]:
    """Returns the neurons among the signals of a `History`, which come first."""
    return [name for name in names if not name.startswith("activation_")]


def plots_of(names: Sequence[str]) -> dict[str, Plot]:
    """Returns the plots that the signals of a `History` make, by the names to choose from; first the default."""
    neurons = neurons_of(names)
    muscles = names[len(neurons) :]
    segments, others = by_segment(neurons)
    plots: dict[str, Plot] = {}
    if segments:
        if (halves := _half_centres(segments)).curves:
            plots["half-centres"] = halves
        for segment, neurons in segments.items():
            labels = [role_of(neuron) for neuron in neurons]
            plots[f"neurons of segment {segment}"] = _plot(f"segment {segment}: potentials (mV)", neurons, labels)
    if others:
        plots["other neurons"] = _plot("potentials (mV)", others, others)
    numbers = [name.removeprefix("activation_") for name in muscles]
    plots["activation"] = _plot("activation of the muscles", muscles, numbers, (-0.05, 1.05))
    return plots


def _plot(title: str, signals: Sequence[str], labels: Sequence[str], limits: tuple[float, float] | None = None) -> Plot:
    curves = tuple(Curve(*names, i) for i, names in enumerate(zip(signals, labels, strict=True)))
    return Plot(title, curves, len(curves), limits)


def _half_centres(segments: dict[int, list[str]]) -> Plot:
    curves: list[Curve] = []
    for number, (segment, neurons) in enumerate(segments.items()):
        if f"contraction_{segment}" in neurons:
            curves.append(Curve(f"contraction_{segment}", str(segment), number))
        if f"expansion_{segment}" in neurons and len(segments) <= MOST_SEGMENTS:
            curves.append(Curve(f"expansion_{segment}", f"{segment} exp.", number, dashed=True))
    words = ", expansion dashed" if any(curve.dashed for curve in curves) else ""
    return Plot(f"contraction{words} (mV)", tuple(curves), len(segments))


class Panel:
    """The panel's elements; what they change is requested of the loop of a view."""

    def __init__(
        self,
        server: viser.ViserServer,
        requests: Requests,
        player: Player,
        stage: Stage,
        config: RunConfig,
        weight_N: float | None,
        legend: str,
        plots: Mapping[str, Plot],
    ) -> None:
        """Makes all elements; pokes are measured by the worm's weight on Earth, None where nothing can be poked."""
        gui = self._gui = server.gui
        self._requests, self._player = requests, player
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        self._status = gui.add_html("")
        self._transport()
        self._knobs: dict[Knob, Any] = {}
        self._poke: Any = None
        if player.worm is not None:
            self._physics(player.worm, weight_N)
        network = network_of(config, neurons) if (neurons := neurons_of(player.history.names)) else None
        self._n_neurons, self._colors = len(neurons), None
        if network is not None:
            with gui.add_folder("Network, coloured by potential", expand_by_default=len(neurons) <= MOST_NEURONS):
                gui.add_html(network_html(network))
                self._colors = gui.add_html("")
        self._plots = {**plots, **plots_of(player.history.names)}
        self._plot_folder = gui.add_folder(f"{'Signals' if plots else 'Nervous system'}, last 5 s")
        self._chart: Any = None
        with self._plot_folder:
            choice = gui.add_dropdown("plot", list(self._plots), initial_value=next(iter(self._plots)))
            choice.on_update(self._requesting(self.choose_plot))
        with gui.add_folder("Colours"):
            gui.add_html(legend)
        with gui.add_folder("Shown", expand_by_default=False):
            follow = gui.add_checkbox("follow the worm", initial_value=True)
            follow.on_update(self._requesting(setattr, stage, "follow"))
            for layer in LAYERS:
                box = gui.add_checkbox(layer, initial_value=True)
                box.on_update(self._requesting(stage.set_visible, layer))
        self.choose_plot(next(iter(self._plots)))

    @property
    def poke_N(self) -> float:
        """Force of a poke as set, N; 0 where nothing can be poked."""
        return float(self._poke.value) if self._poke is not None else 0.0

    def _transport(self) -> None:
        gui, player = self._gui, self._player
        living = player.worm is not None
        buttons = {PLAY: player.toggle, **({NOW: player.go_live} if living else {}), AGAIN: player.restart}
        live_hint = "Live: the present, and on from there. Restart: time zero, with the sliders as they are."
        row = gui.add_button_group("", list(buttons), hint=live_hint if living else "Restart: from the beginning.")
        row.on_click(lambda event: self._requests.add(buttons[str(event.target.value)]))
        self._time = gui.add_slider("time (s)", 0.0, 0.01, 0.01, 0.0, hint="Drag to look at another time.")
        self._time.on_update(self._requesting(player.seek))
        hint = "Simulated seconds per second; the worm may not keep up."
        pace = gui.add_slider("speed", SLOWEST, FASTEST, 0.05, player.speed, hint=hint)
        pace.on_update(self._requesting(setattr, player, "speed"))

    def _physics(self, worm: LiveWorm, weight_N: float | None) -> None:
        gui = self._gui
        with gui.add_folder("Physics"):
            for knob in knobs_of(worm.config):
                self._knobs[knob] = gui.add_slider(
                    knob.label, knob.low, knob.high, knob.step, knob.shown(worm.config), hint=knob.hint
                )
                self._knobs[knob].on_update(self._requesting(worm.turn, knob))
            if weight_N is not None:
                hint = "Force of a poke, the worm's weight at first: click on the worm to push it away for 0.15 s."
                self._poke = gui.add_slider("poke (N)", 0.0, STRONGEST_POKE * weight_N, 0.1, weight_N, hint=hint)
            again = gui.add_button("Reset sliders", hint="Gives every slider above its first value.")
            again.on_click(lambda _: self._requests.add(self._reset, worm))

    def _reset(self, worm: LiveWorm) -> None:
        worm.reset_fields()
        for knob, slider in self._knobs.items():
            slider.value = knob.shown(worm.config)

    def _requesting(self, call: Callable[..., Any], *first: Any) -> Callable[[Any], None]:
        """Requests a call with an element's value as its last argument, if it was the user who changed it."""

        def on_update(event: Any) -> None:
            if event.client_id is not None:
                self._requests.add(call, *first, event.target.value)

        return on_update

    def choose_plot(self, name: str) -> None:
        """Puts another plot in place of the present one; it is empty until `update`."""
        self._plot = plot = self._plots[name]
        signals = () if plot.series else (curve.signal for curve in plot.curves)
        self._columns = [self._player.history.names.index(signal) for signal in signals]
        if self._chart is not None:
            self._chart.remove()
        colors = [_css(color) for color in segment_colors(max(plot.n_colors, 1))]
        y: dict[str, Any] = {} if plot.limits is None else {"range": plot.limits}
        with self._plot_folder:
            self._chart = self._gui.add_uplot(
                tuple(np.zeros(2) for _ in range(1 + len(plot.curves))),
                ({"label": "s"}, *(_series(curve, colors) for curve in plot.curves)),
                title=plot.title,
                scales={"x": {"time": False}, "y": y},  # type: ignore[dict-item]
                legend={"show": len(plot.curves) <= 8, "live": False},
                cursor={"show": False},
                height=PLOT_HEIGHT,
            )

    def update(self, status: str) -> None:
        """Shows the state of things, as HTML, the present time, and the signals of the last seconds before it."""
        self._status.content = status
        history, time_s = self._player.history, self._player.moment.time_s
        first, last = history.span_s
        self._time.min, self._time.max = first, max(last, first + 0.01)
        self._time.value = time_s
        times, values = history.window(time_s - SECONDS, time_s, MOST_SAMPLES)
        if len(times):
            drawn = (times, *values[:, self._columns].T)
            self._chart.data = self._plot.window(time_s - SECONDS, time_s) if self._plot.series else drawn
            if self._colors is not None:
                self._colors.content = colors_html(values[-1, : self._n_neurons])


def _series(curve: Curve, colors: Sequence[str]) -> Any:
    series: dict[str, Any] = {"label": curve.label, "stroke": colors[curve.number], "points": {"show": False}}
    return series | ({"dash": (6, 4), "width": 1.1} if curve.dashed else {"width": 1.6})


def legend_html(arrow_N: float, radius_m: float, colored: str = "") -> str:
    """Returns the legend; the arrow of this contact force is as long as the radius.

    What is no worm has instead of its parts what is ``colored`` by the activation.
    """
    percent = f"{100 * SPRING_RANGE:.0f}&thinsp;%"
    rows = (
        (_bar(STRAND_COLORS, smooth=False), "strands: dark and light blue wind in opposite directions"),
        (_bar((RELAXED, CONTRACTED)), "ring muscles, activation 0 to 1"),
        (_bar(SPRING_COLORS), f"axial springs, {percent} shorter to {percent} longer than at rest"),
        (
            f'<span style="color:{_css(CONTACT_COLOR)};font-size:1.3em;line-height:0.8">&#8593;</span>',
            f"force of the ground on a segment: {100 * radius_m:.0f}&thinsp;cm are {arrow_N:g}&thinsp;N",
        ),
    )
    if colored:
        rows = ((_bar((RELAXED, CONTRACTED)), colored), rows[-1])
    cells = "".join(
        f'<tr><td style="padding:2px 8px 2px 0;text-align:center">{mark}</td><td>{words}</td></tr>'
        for mark, words in rows
    )
    return f'<table style="font-size:0.8em;line-height:1.25;border-collapse:collapse;margin-left:0.6em">{cells}</table>'


def status_html(name: str, parts: Sequence[str], below: str) -> str:
    """Returns the worm's name, what stands beside it and a sentence below, or none, every word as it was written."""
    line = "&emsp;".join([f"<b>{html.escape(name)}</b>", *map(html.escape, parts)])
    rest = f'<div style="margin-top:0.5em">{html.escape(below)}</div>' if below else ""
    return f'<div style="font-size:0.9em;margin:0 0.6em;overflow-wrap:anywhere">{line}{rest}</div>'


def _bar(colors: Sequence[Sequence[float]], *, smooth: bool = True) -> str:
    stops = ",".join(_css(color) for color in colors)
    if not smooth:
        stops = f"{_css(colors[0])} 50%,{_css(colors[1])} 50%"
    style = f"display:inline-block;width:4em;height:0.8em;background:linear-gradient(90deg,{stops})"
    return f'<span style="{style}"></span>'


def _css(color: Any) -> str:
    return color if isinstance(color, str) else "#" + "".join(f"{round(255 * channel):02x}" for channel in color[:3])
