"""What a user may set: frozen models with the unit in every field's name, and the named presets.

A configuration is a tree of sections (`run`, `worm`, `planar`, `controllers`). A preset is a commented TOML file in
``annelid/presets`` that states every field with its source; a user's own TOML file may start from one (``extends =
"riddle2023"``), and any field can be overridden by its dotted path (``body.mesh.n_segments=4``). A level of `fidelity`
sets how finely a 3D worm is resolved.
"""

from annelid.config.arena import Arena
from annelid.config.checking import check_config, field_paths, fields_of
from annelid.config.controllers import (
    AdaptiveSns,
    Contraction,
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
from annelid.config.loading import load_config, parse_assignments, preset_names, preset_text, toml_value
from annelid.config.planar import Boxerbaum2012Body, Daltorio2013Body, DynamicPlanarWorm, PlanarBody, PlanarWorm
from annelid.config.run import Clock, Guard, Record, RunConfig
from annelid.config.sections import Section
from annelid.config.worm import Chain, Joints, Mesh, Pins, Rings, Rods, ServoRings, Springs, Strands, WormBody

__all__ = [
    "LEVELS",
    "AdaptiveSns",
    "Arena",
    "Boxerbaum2012Body",
    "Chain",
    "Clock",
    "Contraction",
    "Daltorio2013Body",
    "DynamicPlanarWorm",
    "Fidelity",
    "Guard",
    "HeteroclinicChannel",
    "Joints",
    "Mesh",
    "PhaseChain",
    "Pins",
    "PlanarBody",
    "PlanarWorm",
    "PressureSns",
    "Program",
    "Record",
    "Rings",
    "RobustSns",
    "Rods",
    "RunConfig",
    "Section",
    "ServoRings",
    "SineWave",
    "SnsController",
    "Springs",
    "Strands",
    "StretchSensor",
    "TimedWave",
    "WormBody",
    "check_config",
    "field_paths",
    "fields_of",
    "find_level",
    "load_config",
    "parse_assignments",
    "preset_names",
    "preset_text",
    "toml_value",
]
