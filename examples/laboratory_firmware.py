"""A laboratory's firmware, unmodified, drives the twin of its robot; path, heading and slip stand beside its plan.

    python examples/laboratory_firmware.py SEC_ver2.ino folder

Fetches nothing (docs/how_to/laboratory_firmware.md says where the file is). Needs a C++ compiler. Takes some minutes.
"""

from __future__ import annotations

import sys
from hashlib import sha256
from pathlib import Path
from subprocess import PIPE, run

import numpy as np

from annelid import load_config, simulate
from annelid.analysis import track_of
from annelid.draw import canvas, save
from annelid_lab.loop import Wheels, Wiring

BESIDE = Path(__file__).with_suffix("")
KNOWN = {"SEC_ver2.ino": "9ffb824a94c322e05dfccfd45bd586c2780c640a13b268049367afebc8466930"}
SERVOS = (7, 1, 8, 2, 9, 3, 10, 4, 11, 5, 12, 6)  # a guess: 1 to 6 are right
HEAD = "wave,path_m,heading_deg,slip_m,plan_path_m,plan_heading_deg"


def main(sketch: Path, folder: Path, worm: str = "cmmworm-s") -> None:
    """Compiles and runs the firmware, drives the twin, prints and writes what each wave did, and draws its path."""
    if (found := sha256(sketch.read_bytes()).hexdigest()) != KNOWN.get(sketch.name, found):
        raise SystemExit(f"{sketch} has the SHA-256 {found}: take the file of commit f823c31")
    folder.mkdir(parents=True, exist_ok=True)
    run(["c++", "-x", "c++", f"-I{BESIDE}", str(sketch), "-o", str(folder / "sketch")], check=True)
    lines = run([str(folder / "sketch")], check=True, stdout=PIPE, text=True, timeout=60).stdout.splitlines()
    words = [(int(us) / 1e6, int(servo), int(word)) for us, servo, word in map(str.split, lines)]
    ends = np.array([*sorted({time for time, _, word in words if word % 1024})[::6], words[-1][0]])[:11]
    wiring = Wiring(0, round(-1.92 * 4096), protocol=1, is_wheel=True, rpm_per_unit=97 / 1023)  # 9 mm: a guess
    wheels = Wheels(words, SERVOS, wiring, cable_m=0.1085, stall_torque_Nm=1.8)
    result = simulate(load_config(worm, {"duration_s": round(ends[-1], 1)}), folder / "run", controller=wheels)
    track, slid_m = track_of(result), result.variables["slip_distance"].values.mean(axis=1)
    motion = (*(track.middle_m[0] - track.middle_m).T, np.degrees(track.heading_rad))  # it starts towards -x
    twin = np.array([np.interp(ends, track.time_s, one) for one in motion])
    plan = np.loadtxt(BESIDE / "plan.csv", delimiter=",", skiprows=1)[: len(ends)].T
    slips = np.diff(np.interp(ends, result.variables["time"].values, slid_m))
    paths = [np.hypot(*np.diff(one[:2])) for one in (twin, plan)]
    rows = np.column_stack([range(1, len(ends)), paths[0], twin[2, 1:], slips, paths[1], plan[2, 1:]])
    np.savetxt(folder / "waves.csv", rows, "%.4g", ",", header=HEAD, comments="")
    print((folder / "waves.csv").read_text(encoding="utf-8"))
    with canvas(3.2) as figure:
        axes = figure.subplots()
        for name, (ahead, left, heading) in (("twin", twin), ("plan without slip", plan)):
            axes.plot(ahead, left, "o-", label=name)
            axes.quiver(ahead, left, *(each(np.radians(heading)) for each in (np.cos, np.sin)), width=0.003)
        axes.set(xlabel="ahead (m)", ylabel="to the left (m)", aspect="equal")
        axes.legend()
        print(save(figure, folder / "waves.png"))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
