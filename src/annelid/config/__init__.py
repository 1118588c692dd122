"""What a user may set: frozen models with the unit in every field's name, and the named presets.

A configuration is a tree of sections (`run`, `worm`, `planar`, `controllers`). A preset is a commented TOML file in
``annelid/presets`` that states every field with its source; a user's own TOML file may start from one (``extends =
"riddle2023"``), and any field can be overridden by its dotted path (``body.mesh.n_segments=4``). A level of `fidelity`
sets how finely a 3D worm is resolved.
"""

from annelid.config.arena import Arena, ArenaSection, Floor, Pipe, Relief, Rough, Steps
from annelid.config.checking import check_config, field_paths, field_value, fields_of, unit_of, whole_path
from annelid.config.cluster import Cluster, find_cluster
from annelid.config.controllers import (
    AdaptiveSns,
    Contraction,
    DescendingDrive,
    HeteroclinicChannel,
    PhaseChain,
    PressureSns,
    Program,
    RobustSns,
    SineWave,
    SnsController,
    StretchSensor,
    TimedWave,
)
from annelid.config.fidelity import LEVELS, Fidelity, find_level
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
from annelid.config.planar import Boxerbaum2012Body, Daltorio2013Body, DynamicPlanarWorm, PlanarBody, PlanarWorm
from annelid.config.run import Clock, Guard, Record, RunConfig
from annelid.config.sections import Section
from annelid.config.study import Study, Vary, load_study
from annelid.config.turning import (
    ConstantTurning,
    CourseTurning,
    HeadingTurning,
    Steered,
    TouchTurning,
    TurningSection,
)
from annelid.config.worm import Chain, Joints, Mesh, Pins, Rings, Rods, ServoRings, Springs, Strands, WormBody
from annelid.textfiles import toml_value

__all__ = [
    "LEVELS",
    "AdaptiveSns",
    "Arena",
    "ArenaSection",
    "Boxerbaum2012Body",
    "Chain",
    "Clock",
    "Cluster",
    "ConstantTurning",
    "Contraction",
    "CourseTurning",
    "Daltorio2013Body",
    "DescendingDrive",
    "DynamicPlanarWorm",
    "Fidelity",
    "Floor",
    "Guard",
    "HeadingTurning",
    "HeteroclinicChannel",
    "Joints",
    "Mesh",
    "PhaseChain",
    "Pins",
    "Pipe",
    "PlanarBody",
    "PlanarWorm",
    "PressureSns",
    "Program",
    "Record",
    "Relief",
    "Rings",
    "RobustSns",
    "Rods",
    "Rough",
    "RunConfig",
    "Section",
    "ServoRings",
    "SineWave",
    "SnsController",
    "Springs",
    "Steered",
    "Steps",
    "Strands",
    "StretchSensor",
    "Study",
    "TimedWave",
    "TouchTurning",
    "TurningSection",
    "Vary",
    "WormBody",
    "arena_names",
    "arena_summary",
    "arena_text",
    "as_config",
    "check_config",
    "field_paths",
    "field_value",
    "fields_of",
    "find_cluster",
    "find_level",
    "load_config",
    "load_study",
    "parse_assignments",
    "preset_names",
    "preset_text",
    "toml_value",
    "unit_of",
    "whole_path",
]
