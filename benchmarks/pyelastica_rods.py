"""Free Cosserat rods of PyElastica with the paper's material at their largest stable step: times real time on one core.

Needs ``pip install pyelastica``. ``annelid bench --cases peer`` puts the same numbers beside annelid's own.
"""

from __future__ import annotations

from annelid_studies.bench.measure import keep_to_one_core
from annelid_studies.bench.peer import peer

if __name__ == "__main__":
    keep_to_one_core()
    for name, value in peer().items():
        print(f"{name:18} {value:.4g}" if isinstance(value, float) else f"{name:18} {value}")
