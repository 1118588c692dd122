"""What friction takes: a stable heteroclinic channel that waits for stretch, against sine waves, in a pipe.

    python examples/slip_of_two_controllers.py [folder]

Daltorio et al. 2013 found that such a channel loses about 40 % less energy to slip than the best sine wave. Here it
comes out the other way round: under one long sine wave a single foothold need not slip, while the channel stretches the
worm between two. Losses are for each metre travelled, since slow waves slip little and go nowhere, and the best wave is
one with a foothold for 95 % of the time, since fast ones glide. Takes some minutes on two cores.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from annelid import Run
from annelid.experiment import Case, Store

CLOCK = {"clock.control_timestep_s": 0.002, "record.signals_interval_s": 0.02, "duration_s": 12.0}
CONTROLLERS = {"channel": {"kind": "shc"}} | {
    f"sine, waves: {waves}, {period_s:g} s": {"kind": "sine", "period_s": period_s, "waves": waves}
    for waves in (1, 2, 3)
    for period_s in (1.0, 2.0, 4.0)
}
CASES = {name: Case("daltorio2013", CLOCK | {"controller": fields}) for name, fields in CONTROLLERS.items()}


def measure(name: str, run: Run) -> tuple[str, float, float, float, float]:
    """Reads a run: name, forward speed (m/s), slip loss and net muscle work (J/m), share without foothold."""
    data, duration_s = run.data, run.config.duration_s
    steady = data.isel(time=data["time"] >= duration_s / 3)
    first, last = steady.isel(time=0), steady.isel(time=-1)
    way = float((first["center_of_mass"] - last["center_of_mass"]).sel(axis="x"))
    slip, work = (float((last[loss] - first[loss]).sum()) for loss in ("slip_loss", "muscle_work"))
    afloat = float((steady["contact_force"].sel(axis="z").max("segment") == 0).mean())
    return name, way / (duration_s * 2 / 3), slip / way, work / way, afloat


def main(folder: Path) -> None:
    """Measures all controllers and compares the channel with the sine wave that slips least."""
    store = Store(folder)
    store.compute(CASES.values())
    results = [measure(name, store.run(case)) for name, case in CASES.items()]
    table = Table("controller", "speed (mm/s)", "slip (J/m)", "muscles (J/m)", "no foothold (%)")
    for name, speed, slip, work, afloat in results:
        table.add_row(name, f"{1000 * speed:.1f}", f"{slip:.2g}", f"{work:.1f}", f"{100 * afloat:.0f}")
    Console().print(table)
    best = min((result for result in results[1:] if result[4] < 0.05), key=lambda result: result[2])
    print(f"The {results[0][0]} loses {results[0][2]:.3g} J/m to slip, the best wave ({best[0]}) {best[2]:.3g} J/m.")


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))
