"""Reading a run with xarray: signals by name, time and segment, units, resampling, and a table for a spreadsheet.

    python examples/signals_with_xarray.py [run]

Without a run of yours it makes one. Writes signals.csv beside where you are.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import annelid


def main(run: annelid.Run, table: Path) -> None:
    """Prints some of what the run holds and writes a table of it."""
    data = run.data
    stretch_m = data["stretch_length"].mean("sensor", keep_attrs=True)
    print(f"{stretch_m.attrs['long_name']}, {stretch_m.attrs['units']}")
    print("longest per segment:", stretch_m.max("time").values.round(3))

    halfway = float(data["time"][-1]) / 2
    print("ring muscles halfway:", data["muscle_force"].sel(time=halfway, method="nearest").values.round(2), "N")
    if "potential" in data:
        first = data["potential"].sel(neuron=[name for name in data["neuron"].values if name.endswith("_1")])
        print("swing of segment 1's neurons:", (first.max("time") - first.min("time")).values.round(1), "mV")
    sides = data["touch"].sum("segment").mean("time")
    print("mean load:", {str(side): round(float(sides.sel(side=side)), 1) for side in data["side"].values}, "N")

    every_m = stretch_m.interp(time=np.arange(0.0, float(data["time"][-1]), 0.1))
    header = ",".join(["time_s", *(f"segment{number}_m" for number in every_m["segment"].values)])
    np.savetxt(table, np.column_stack([every_m["time"], every_m]), delimiter=",", header=header, comments="")
    print(table)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(annelid.open_run(sys.argv[1]), Path("signals.csv"))
    else:
        with TemporaryDirectory() as temporary:
            main(annelid.simulate("riddle2023-rods", temporary), Path("signals.csv"))
