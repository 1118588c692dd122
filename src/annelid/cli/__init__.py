"""The command line, a thin skin over the library. Heavy imports are inside the commands, so help is quick."""

from annelid.cli.entry import Command, app, experiments, main
from annelid.cli.gallery import gallery_command
from annelid.cli.hardware import loop_command, pseudo_robot_command
from annelid.cli.result import with_json
from annelid.cli.results import cite, compare_command, export_command, plot, render, show, view_command
from annelid.cli.run import limit_cycle_command, run_command
from annelid.cli.runs import runs_command
from annelid.cli.studies import (
    bench_command,
    calibrate_command,
    challenge_command,
    paper_command,
    robustness_command,
    sweep_command,
    tune_command,
)
from annelid.cli.worm import arenas, build, check, doctor, export_network, new, presets
from annelid.registry import load_extensions, load_home

__all__ = ["app", "main"]

_NO_JSON = {"view", "cite", "pseudo-robot"}
"""A view and a pseudo-robot go on until they are ended; BibTeX is a format for programs already."""

# In the order in which the help lists them.
for _name, _command in (
    ("run", run_command),
    ("new", new),
    ("check", check),
    ("build", build),
    ("export-network", export_network),
    ("loop", loop_command),
    ("pseudo-robot", pseudo_robot_command),
    ("runs", runs_command),
    ("show", show),
    ("compare", compare_command),
    ("plot", plot),
    ("render", render),
    ("view", view_command),
    ("export", export_command),
    ("limit-cycle", limit_cycle_command),
    ("paper", paper_command),
    ("bench", bench_command),
    ("challenge", challenge_command),
    ("robustness", robustness_command),
    ("sweep", sweep_command),
    ("tune", tune_command),
    ("calibrate", calibrate_command),
    ("gallery", gallery_command),
    ("cite", cite),
    ("presets", presets),
    ("arenas", arenas),
    ("doctor", doctor),
):
    app.command(_name, cls=Command)(_command if _name in _NO_JSON else with_json(_command))
app.add_typer(experiments, name="experiment")
load_home("annelid.cli.experiment")
load_extensions()
