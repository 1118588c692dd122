"""A soft, peristaltic earthworm robot in 3D, driven by a synthetic nervous system.

The names below are loaded on first use, so that ``import annelid`` is quick and needs no engine::

    import annelid

    config = annelid.load_config("riddle2023-rods", {"arena.friction": 0.3})
    run = annelid.simulate(config, "runs/slippery")
    print(annelid.summary(run).period_s)
"""

from __future__ import annotations

from annelid.lazy import lazy

# typing takes longer to load than all else here.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from annelid.analysis import gait, summary
    from annelid.config import Finding, RunConfig, load_config, preset_names
    from annelid.draw.notebook import plot, video
    from annelid.experiment.sweep import sweep
    from annelid.nervous import Network
    from annelid.plausibility import check
    from annelid.protocols import Controller, Plant, Sensation
    from annelid.simulation import Run, build_controller, build_plant, open_run, simulate

__version__ = "0.2.0"

__all__ = [
    "Controller",
    "Finding",
    "Network",
    "Plant",
    "Run",
    "RunConfig",
    "Sensation",
    "__version__",
    "build_controller",
    "build_plant",
    "check",
    "gait",
    "load_config",
    "open_run",
    "plot",
    "preset_names",
    "simulate",
    "summary",
    "sweep",
    "video",
]

_MANY = "run many worms with annelid.sweep or annelid.experiment.Store, which compute them in processes"
__getattr__, __dir__ = lazy(__name__, {"simulate_batch": _MANY, "BatchResult": _MANY})
