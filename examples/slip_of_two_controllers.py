"""What friction takes: a stable heteroclinic channel that feels contact, against sine waves, in a pipe.

    python examples/slip_of_two_controllers.py [folder]

Daltorio et al. 2013 found that such a channel loses about 40 % less energy to slip than the best sine wave. Coulomb
friction does not ask how fast a vertex slides, so slow waves would win by standing still: losses are given for each
metre travelled, after the first third of every run. Fast waves leave the walls altogether and glide: the best one is
sought among those under which the worm has a foothold for 95 % of the time. In this model it comes out the other way
round: under one long sine wave about one segment at a time touches the wall, and a single foothold need not slip,
while the channel lets go of one segment at a time and stretches the worm between the others. Takes some minutes on
two cores.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from annelid import load_config, simulate

DURATION_S = 12.0
SINES = {
    f"sine, {waves} wave{'s' * (waves > 1)}, {period_s:g} s": {
        "controller.kind": "sine",
        "controller.period_s": period_s,
        "controller.waves": waves,
    }
    for waves in (1, 2, 3)
    for period_s in (1.0, 2.0, 4.0)
}
CHANNELS = {
    f"channel, {feedback}": {"controller.kind": "shc", "controller.feedback": feedback}
    for feedback in ("contact", "stretch", "none")
}


def measure(name: str, folder: Path) -> tuple[str, float, float, float, float]:
    """Runs one controller: its name, speed (m/s), slip loss and muscle work (J/m), share of time without foothold."""
    changes = {**(SINES | CHANNELS)[name], "clock.control_timestep_s": 0.002, "record.signals_interval_s": 0.02}
    config = load_config("daltorio2013", {**changes, "duration_s": DURATION_S, "record.frames_interval_s": 0.04})
    data = simulate(config, folder / name, progress=False).data
    steady = data.isel(time=data["time"] >= DURATION_S / 3)
    way = abs(float(steady["center_of_mass"].sel(axis="x")[[0, -1]].diff("time").item()))
    slip, work = (float(steady[what].sum(along)[[0, -1]].diff("time").item()) for what, along in LOSSES)
    afloat = float((steady["contact_force"].sel(axis="z").max("segment") == 0).mean())
    return name, way / (DURATION_S * 2 / 3), slip / way, work / way, afloat


LOSSES = (("slip_loss", "segment"), ("muscle_work", "muscle"))


def main(folder: Path) -> None:
    """Measures all controllers and compares the channel with the sine wave that slips least."""
    names = [*CHANNELS, *SINES]
    with ProcessPoolExecutor(2) as pool:
        results = list(pool.map(measure, names, [folder] * len(names)))
    table = Table("controller", "speed (mm/s)", "slip (J/m)", "muscles (J/m)", "no foothold (%)")
    for name, speed, slip, work, afloat in results:
        table.add_row(name, f"{1000 * speed:.1f}", f"{slip:.2g}", f"{work:.1f}", f"{100 * afloat:.0f}")
    Console().print(table)
    holding = [result for result in results[len(CHANNELS) :] if result[4] < 0.05]
    best = min(holding, key=lambda result: result[2])
    print(f"The {results[0][0]}, loses {results[0][2]:.3g} J/m to slip, the best wave ({best[0]}) {best[2]:.3g} J/m.")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with TemporaryDirectory() as temporary:
            main(Path(temporary))
