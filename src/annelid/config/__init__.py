"""What a user may set: frozen models with the unit in every field's name, and the named presets.

A configuration is a tree of sections (`models`). A preset is a commented TOML file in ``annelid/presets`` that
states every field with its source; a user's own TOML file may start from one (``extends = "riddle2023"``), and
any field can be overridden by its dotted path (``body.mesh.n_segments=4``).
"""

from annelid.config.checking import check_config, field_paths, fields_of
from annelid.config.loading import load_config, parse_assignments, preset_names, preset_text, toml_value
from annelid.config.models import (
    Arena,
    Chain,
    Clock,
    Contraction,
    Guard,
    Mesh,
    Pins,
    PlanarBody,
    Program,
    Record,
    Rings,
    Rods,
    RunConfig,
    Section,
    SnsController,
    Springs,
    Strands,
    StretchSensor,
    WormBody,
)

__all__ = [
    "Arena",
    "Chain",
    "Clock",
    "Contraction",
    "Guard",
    "Mesh",
    "Pins",
    "PlanarBody",
    "Program",
    "Record",
    "Rings",
    "Rods",
    "RunConfig",
    "Section",
    "SnsController",
    "Springs",
    "Strands",
    "StretchSensor",
    "WormBody",
    "check_config",
    "field_paths",
    "fields_of",
    "load_config",
    "parse_assignments",
    "preset_names",
    "preset_text",
    "toml_value",
]
