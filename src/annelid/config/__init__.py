"""What a user may set: frozen models with the unit in every field's name, and the named presets.

A configuration is a tree of sections (`run`); which controllers, bodies, their parts, arenas and turnings there are,
`kinds` finds. A preset is a commented TOML file in ``annelid/presets`` that states its fields with their sources, or
those in which it differs from another (``extends = "riddle2023"``), as a user's own TOML file may. Any field can be
overridden by its dotted path (``body.mesh.n_segments=4``). A level of `fidelity` sets how finely a 3D worm is resolved.
"""

from __future__ import annotations

from annelid.config.answers import Elements, Finding, OwnModel
from annelid.config.checking import (
    check_config,
    check_section,
    field_paths,
    field_value,
    fields_of,
    unit_of,
    whole_path,
)
from annelid.config.fidelity import LEVELS, Fidelity, find_level
from annelid.config.kinds import Choice, Kind, Knob, default_of, kinds_of
from annelid.config.loading import (
    add_presets,
    arena_names,
    arena_summary,
    arena_text,
    as_config,
    load_config,
    parse_assignments,
    preset_names,
    preset_text,
)
from annelid.config.run import ArenaKind, BodyKind, ControllerKind, RunConfig, TrialKind, TurningKind
from annelid.config.sections import Length, Line, NonNegative, Positive, Section, Share
from annelid.config.settings import Clock, Guard, Record, StretchSensor
from annelid.config.study import Study, Vary, load_study
from annelid.textfiles import toml_value

__all__ = [
    "LEVELS",
    "ArenaKind",
    "BodyKind",
    "Choice",
    "Clock",
    "ControllerKind",
    "Elements",
    "Fidelity",
    "Finding",
    "Guard",
    "Kind",
    "Knob",
    "Length",
    "Line",
    "NonNegative",
    "OwnModel",
    "Positive",
    "Record",
    "RunConfig",
    "Section",
    "Share",
    "StretchSensor",
    "Study",
    "TrialKind",
    "TurningKind",
    "Vary",
    "add_presets",
    "arena_names",
    "arena_summary",
    "arena_text",
    "as_config",
    "check_config",
    "check_section",
    "default_of",
    "field_paths",
    "field_value",
    "fields_of",
    "find_level",
    "kinds_of",
    "load_config",
    "load_study",
    "parse_assignments",
    "preset_names",
    "preset_text",
    "toml_value",
    "unit_of",
    "whole_path",
]
