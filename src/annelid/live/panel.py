"""The panel beside the scene: what is played, what can be turned, the neurons, and what the colours mean."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from annelid.draw.style import segment_colors
from annelid.live.knobs import Knob
from annelid.live.player import FASTEST, SLOWEST
from annelid.live.stage import LAYERS
from annelid.live.traces import Curve, Plot

if TYPE_CHECKING:
    import viser

    from annelid.live.show import Show

PLAY, NOW, AGAIN = "play / pause", "now", "restart"
STRONGEST_POKE = 3.0
"""In weights of the worm; more would tear the thinnest."""
PLOT_HEIGHT = 190
"""Of the plots, pixels."""


class Panel:
    """The panel's elements.

    Attributes:
        poke_N: Force of a poke as set, N; 0 where nothing can be poked.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        show: Show,
        *,
        living: bool,
        speed: float,
        weight_N: float,
        knobs: Mapping[Knob, float],
        plots: Mapping[str, Plot],
        legend: str,
    ) -> None:
        """Makes all elements.

        Args:
            server: Where they are seen.
            show: Whom they ask.
            living: Whether the worm runs, else it was recorded.
            speed: Simulated seconds a second at the start.
            weight_N: Of the worm on Earth, which pokes are measured by.
            knobs: What can be turned, with the values that are shown first.
            plots: What can be plotted, by name; the first is.
            legend: What colours mean, as HTML.
        """
        gui = self._gui = server.gui
        self._living = living
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        self._status = gui.add_html("")
        self._transport(show, living, speed)
        self._knobs: dict[Knob, Any] = {}
        self._poke: Any = None
        if living:
            with gui.add_folder("Physics"):
                for knob, shown in knobs.items():
                    self._knobs[knob] = self._knob(show, knob, shown)
                self._poke = gui.add_slider(
                    "poke (N)",
                    0.0,
                    STRONGEST_POKE * weight_N,
                    0.1,
                    weight_N,
                    hint="Force of a poke, the worm's weight at first: click on the worm, which is pushed away from "
                    "you for 0.15 s.",
                )
                gui.add_button("as at first", hint="Gives every slider above its first value.").on_click(
                    lambda _: show.ask(show.reset_knobs)
                )
        self._plot_folder = gui.add_folder("Nervous system, last 5 s")
        self._chart: Any = None
        with self._plot_folder:
            names = list(plots)
            choice = gui.add_dropdown("plot", names, initial_value=names[0])
            choice.on_update(lambda event: show.ask(show.choose_plot, str(event.target.value)))
        self.show_plot(plots[names[0]])
        with gui.add_folder("Colours"):
            gui.add_html(legend)
        with gui.add_folder("Shown", expand_by_default=False):
            follow = gui.add_checkbox("follow the worm", initial_value=True)
            follow.on_update(lambda event: show.ask(show.set_follow, bool(event.target.value)))
            for layer in LAYERS:
                self._layer(show, layer)

    @property
    def poke_N(self) -> float:
        """Force of a poke, N."""
        return float(self._poke.value) if self._poke is not None else 0.0

    def _transport(self, show: Show, living: bool, speed: float) -> None:
        gui = self._gui
        buttons = {PLAY: show.play_or_pause, **({NOW: show.go_live} if living else {}), AGAIN: show.restart}
        row = gui.add_button_group(
            "",
            list(buttons),
            hint="now: the present, and on from there. restart: time zero, with the sliders as they are."
            if living
            else "restart: from the beginning.",
        )
        row.on_click(lambda event: show.ask(buttons[str(event.target.value)]))
        self._time = gui.add_slider("time (s)", 0.0, 0.01, 0.01, 0.0, hint="Drag to look at another time.")
        self._time.on_update(_from_user(lambda value: show.ask(show.seek, float(value))))
        pace = gui.add_slider(
            "speed", SLOWEST, FASTEST, 0.05, speed, hint="Simulated seconds a second; the worm may not keep up."
        )
        pace.on_update(_from_user(lambda value: show.ask(show.set_speed, float(value))))

    def _knob(self, show: Show, knob: Knob, shown: float) -> Any:
        slider = self._gui.add_slider(knob.label, knob.low, knob.high, knob.step, shown, hint=knob.hint)
        slider.on_update(_from_user(lambda value: show.ask(show.turn, knob.field, knob.value(float(value)))))
        return slider

    def _layer(self, show: Show, layer: str) -> None:
        box = self._gui.add_checkbox(layer, initial_value=True)
        box.on_update(lambda event: show.ask(show.set_visible, layer, bool(event.target.value)))

    def tell(self, status: str) -> None:
        """Shows the state of things first, as HTML."""
        self._status.content = status

    def show_time(self, time_s: float, span_s: tuple[float, float]) -> None:
        """Moves the slider of time."""
        first, last = span_s
        self._time.min = first
        self._time.max = max(last, first + 0.01)
        self._time.value = time_s

    def show_knobs(self, shown: Mapping[Knob, float]) -> None:
        """Moves the sliders."""
        for knob, value in shown.items():
            self._knobs[knob].value = value

    def show_plot(self, plot: Plot) -> None:
        """Puts another plot in place of the present one; it is empty until `show_curves`."""
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

    def show_curves(self, time_s: NDArray[np.float64], values: Sequence[NDArray[np.float64]]) -> None:
        """Draws the signals of the present plot, one array a curve."""
        self._chart.data = (time_s, *values)


def _series(curve: Curve, colors: Sequence[str]) -> Any:
    series: dict[str, Any] = {"label": curve.label, "stroke": colors[curve.number], "width": 1.6}
    series["points"] = {"show": False}
    return series | ({"dash": (6, 4), "width": 1.1} if curve.dashed else {})


def _from_user(tell: Callable[[Any], None]) -> Callable[[Any], None]:
    """Passes on what a user does to a slider, not what `Panel` itself sets it to."""

    def on_update(event: Any) -> None:
        if event.client_id is not None:
            tell(event.target.value)

    return on_update


def _css(color: Any) -> str:
    if isinstance(color, str):
        return color
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in color[:3])
