"""What a user may set: frozen models with the unit in every field's name, and the named presets.

A configuration is a tree of sections (`run`); which controllers, bodies, their parts, arenas and turnings there are,
`kinds` finds. A preset is a commented TOML file in ``annelid/presets`` that states its fields with their sources, or
those in which it differs from another (``extends = "riddle2023"``), as a user's own TOML file may. Any field can be
overridden by its dotted path (``body.mesh.n_segments=4``). A level of `fidelity` sets how finely a 3D worm is resolved.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

from annelid.config.checking import (
    REPLACED,
    check_config,
    check_section,
    field_paths,
    field_value,
    fields_of,
    has_field,
    unit_of,
    whole_path,
)
from annelid.config.cluster import Cluster, find_cluster
from annelid.config.fidelity import LEVELS, Fidelity, find_level
from annelid.config.kinds import Knob, class_named, kinds_of
from annelid.config.loading import (
    arena_names,
    arena_summary,
    arena_text,
    as_config,
    load_config,
    parse_assignments,
    preset_names,
    preset_text,
)
from annelid.config.run import ArenaKind, BodyKind, ControllerKind, RunConfig, TurningKind
from annelid.config.sections import Section
from annelid.config.settings import Clock, Guard, Record, StretchSensor
from annelid.config.study import Study, Vary, load_study
from annelid.textfiles import toml_value

_MOVED = dict.fromkeys(("Joints", "Mesh", "Pins", "Springs", "Strands"), "annelid.body.mesh") | {
    "Contraction": "annelid.config.settings",
    "DescendingDrive": "annelid.control.robust",
}
"""Sections that are no kinds, which the first edition had here."""
_RENAMED = {"SnsController": "Sns", "Arena": "ArenaKind"}
"""Names of the first edition that differ from today's."""

__all__ = [
    "LEVELS",
    "REPLACED",
    "ArenaKind",
    "BodyKind",
    "Clock",
    "Cluster",
    "ControllerKind",
    "Fidelity",
    "Guard",
    "Knob",
    "Record",
    "RunConfig",
    "Section",
    "StretchSensor",
    "Study",
    "TurningKind",
    "Vary",
    "arena_names",
    "arena_summary",
    "arena_text",
    "as_config",
    "check_config",
    "check_section",
    "field_paths",
    "field_value",
    "fields_of",
    "find_cluster",
    "find_level",
    "has_field",
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


def __getattr__(name: str) -> Any:
    """Finds names of the first edition where they are now, for one release."""
    if name in _MOVED:
        found = getattr(import_module(_MOVED[name]), name)
    else:
        found = class_named(_RENAMED.get(name, name)) if not name.startswith("_") else None
    if found is None:
        raise AttributeError(f"module 'annelid.config' has no attribute {name!r}")
    where = f"{found.__module__}.{found.__name__}"
    warnings.warn(f"annelid.config.{name} is now {where}", DeprecationWarning, stacklevel=2)
    return found
