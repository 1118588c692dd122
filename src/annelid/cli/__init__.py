"""The command line, a thin skin over the library. Heavy imports are inside the commands, so help is quick.

Another package adds a command by an entry point `annelid.registry.COMMANDS`, which names a module that decorates
functions with `command` or `study`; the names below are what such a module builds on.
"""

from annelid.cli.common import (
    FIRST_PRESET,
    RIGID_PRESET,
    ArenaName,
    Assignments,
    FidelityLevel,
    Force,
    Jobs,
    NamedPreset,
    OnlyPaths,
    Output,
    Preset,
    Quiet,
    ResultsFolder,
    RunPath,
    Segments,
    config_of,
    going_on,
    kept_runs,
    names_worm,
    overrides_of,
    play,
    print_paths,
    print_results,
    print_run,
    print_worm,
    refuse_existing,
    runs_from,
)
from annelid.cli.entry import (
    EXIT_ALL_FAILED,
    EXIT_INTERRUPTED,
    EXIT_SOME_FAILED,
    EXIT_STOPPED,
    app,
    command,
    complain,
    end_study,
    lock,
    main,
    remark,
    study,
    typed_command,
)
from annelid.cli.json_output import give, give_files, refuse_json, wants_json
from annelid.cli.run import locked_folder
from annelid.registry import COMMANDS, load_extensions, load_home

__all__ = [
    "EXIT_ALL_FAILED",
    "EXIT_INTERRUPTED",
    "EXIT_SOME_FAILED",
    "EXIT_STOPPED",
    "FIRST_PRESET",
    "RIGID_PRESET",
    "ArenaName",
    "Assignments",
    "FidelityLevel",
    "Force",
    "Jobs",
    "NamedPreset",
    "OnlyPaths",
    "Output",
    "Preset",
    "Quiet",
    "ResultsFolder",
    "RunPath",
    "Segments",
    "app",
    "command",
    "complain",
    "config_of",
    "end_study",
    "give",
    "give_files",
    "going_on",
    "kept_runs",
    "lock",
    "locked_folder",
    "main",
    "names_worm",
    "overrides_of",
    "play",
    "print_paths",
    "print_results",
    "print_run",
    "print_worm",
    "refuse_existing",
    "refuse_json",
    "remark",
    "runs_from",
    "study",
    "typed_command",
    "wants_json",
]

# The help lists commands in this order.
for _home in ("run", "check", "see", "sweep_and_tune", "lists"):
    load_home(f"annelid.cli.{_home}")
load_extensions(COMMANDS)
