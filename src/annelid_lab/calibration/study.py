"""What identifies a robot: a study, as a user writes it, of a worm, parameters and experiments."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from math import log, log1p, sqrt
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from annelid.config import (
    Choice,
    Line,
    Positive,
    RunConfig,
    Section,
    check_section,
    field_paths,
    load_config,
    preset_names,
    whole_path,
)
from annelid.errors import ConfigError, shown, suggest
from annelid.experiment import SHEAR_OVER_YOUNG
from annelid.textfiles import check_depth, read_toml
from annelid_lab.calibration.base import Experiment, file_beside

MOST = 20
"""Parameters, and experiments, that a study may have."""
ROBOT = Path(__file__).parent.parent / "data" / "identify_robot.toml"
"""The study of the robot that annelid's data are of."""
EXAMPLES = {
    "robot": (ROBOT.name, "tube_tensile.csv", "segment_load_frame.csv"),
    "walk": ("identify_walk.toml", "walk.csv", "walk.map.toml"),
}
"""Studies that come with annelid, each with its data, in the folder of the data."""


class Prior(Section):
    """What is known of a parameter before: a log-normal distribution."""

    mean: Positive = Field(description="mean, in the parameter's unit")
    sd: Positive = Field(description="standard deviation, in the same")

    def row(self, log_value: float) -> tuple[float, float]:
        """Returns the residual of a logarithm in standard deviations, and its derivative."""
        square = log1p((self.sd / self.mean) ** 2)
        return (log_value - log(self.mean) + square / 2.0) / sqrt(square), 1.0 / sqrt(square)


class Parameter(Section):
    """One thing that a fit may change: from a first guess, between two bounds."""

    unit: Line = Field(default="1", description="unit of its value")
    start: Positive = Field(description="first guess")
    low: Positive = Field(description="lower bound")
    high: Positive = Field(description="upper bound")
    fields: Annotated[Mapping[str, float], Field(max_length=20)] = Field(
        description="fields that it sets, by dotted path of the worm or experiments.NAME.FIELD, and each over its value"
    )
    prior: Prior | None = Field(default=None, description="what is known of it before; none: nothing")


def _known(unit: str, start: float, low: float, high: float, fields: Mapping[str, float]) -> Parameter:
    return Parameter(unit=unit, start=start, low=low, high=high, fields=fields)


_MODULUS = {"body.strands.young_modulus_Pa": 1.0, "body.strands.shear_modulus_Pa": SHEAR_OVER_YOUNG}
PARAMETERS: Mapping[str, Parameter] = {
    "young_modulus": _known("Pa", 6e8, 5e7, 5e9, _MODULUS),
    "dry_friction": _known("N m", 0.01, 1e-4, 0.2, {"body.joints.dry_friction_Nm": 1.0}),
    "cable_friction": _known("1", 1.4, 1e-3, 4.0, {"experiments.load-frame.cable_friction": 1.0}),
    "softening_strain": _known("1", 0.01, 5e-4, 0.5, {"experiments.tensile.softening_strain": 1.0}),
    "damping_time": _known("s", 0.05, 1e-3, 2.0, {"body.strands.damping_time_s": 1.0}),
    "spring_rate": _known("N/m", 24.5, 2.0, 100.0, {"body.springs.stiffness_N_per_m": 1.0}),
    "spring_rest_length": _known("m", 0.065, 0.05, 0.0748, {"body.springs.rest_length_m": 1.0}),
    "viscous_friction": _known("N m s/rad", 0.02, 1e-4, 5.0, {"body.joints.viscous_friction_Nms_per_rad": 1.0}),
    "floor_friction": _known("1", 0.5, 0.01, 5.0, {"arena.friction": 1.0}),
}
"""What a study need only name. A field ``experiments.KIND.FIELD`` is of all experiments of that kind."""


class IdentifyStudy(Section):
    """A worm, parameters and experiments."""

    name: Line = Field(default="identification", max_length=200, description="for titles")
    preset: Line = Field(description="name of a preset, or a TOML file beside the study or below it")
    set: Mapping[str, Any] = Field(default_factory=dict, description="fields that differ from it in every experiment")
    parameters: Mapping[str, Parameter] = Field(
        max_length=MOST, description="what is fitted; of one that annelid knows, only what differs"
    )
    experiments: tuple[Annotated[Experiment, Choice()], ...] = Field(max_length=MOST, description="what was measured")

    @model_validator(mode="before")
    @classmethod
    def _with_what_is_known(cls, given: Any) -> Any:
        named = given.get("parameters") if isinstance(given, Mapping) else None
        if not isinstance(named, Mapping):
            return given
        known = {name: one.model_dump(exclude_none=True) for name, one in PARAMETERS.items()}
        whole = {n: {**known.get(n, {}), **own} if isinstance(own, Mapping) else own for n, own in named.items()}
        return {**given, "parameters": whole}

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if not self.experiments or not self.parameters:
            raise ValueError(f"the study must name parameters ({', '.join(PARAMETERS)}) and experiments to fit them to")
        names = [one.name for one in self.experiments]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"experiments: the name {shown(name)} stands twice")
        for name, one in self.parameters.items():
            if not one.low < one.high:
                raise ValueError(f"parameters.{name}: low = {one.low:g} must be below high = {one.high:g}")
            if not one.low <= one.start <= one.high:
                raise ValueError(
                    f"parameters.{name}.start = {one.start:g} must be from low = {one.low:g} to high = {one.high:g}"
                )
            if not any(self.paths(field) for field in one.fields):
                raise ValueError(f"parameters.{name}: no experiment has one of its fields: {', '.join(one.fields)}")
        fitted = {path for one in self.parameters.values() for field in one.fields for path in self.paths(field)}
        for one in self.experiments:
            if both := fitted & {whole_path(field, {}) for field in one.set}:
                raise ValueError(
                    f"experiments.{one.name}.set: {shown(min(both))} is fitted by a parameter; leave one of the two out"
                )
        return self

    def paths(self, field: str) -> list[str]:
        """Returns what a parameter's field means: one of the worm, or one of each experiment of a name or a kind.

        Raises:
            ValueError: There is no such field; it suggests one.
        """
        first, _, rest = field.partition(".")
        if first != "experiments":
            if (whole := whole_path(field, {})) not in (known := field_paths()):
                raise ValueError(f"unknown field {shown(field)}: {suggest(field, known)}")
            return [whole]
        name, _, own = rest.partition(".")
        meant = [one for one in self.experiments if name in (one.name, one.kind)]
        for one in meant:
            if own not in type(one).model_fields:
                raise ValueError(f"unknown field {shown(field)}: {suggest(own, type(one).model_fields)}")
        return [f"experiments.{one.name}.{own}" for one in meant]

    def only(self, names: Iterable[str]) -> IdentifyStudy:
        """Returns the study with only these parameters, of its own or those that annelid knows.

        Raises:
            ConfigError: One is neither.
        """
        known = {**PARAMETERS, **self.parameters}
        for name in names:
            if name not in known:
                raise ConfigError(f"unknown parameter {shown(name)}: {suggest(name, known)}")
        chosen = {name: known[name].model_dump(exclude_none=True) for name in names}
        return check_section(IdentifyStudy, {**self.model_dump(exclude_none=True), "parameters": chosen})

    def holding_out(self, names: Collection[str]) -> IdentifyStudy:
        """Returns the study with these experiments predicted and not fitted.

        Raises:
            ConfigError: There is none of a name.
        """
        known = [one.name for one in self.experiments]
        for name in names:
            if name not in known:
                raise ConfigError(f"unknown experiment {shown(name)}: {suggest(name, known)}")
        each = [
            one.model_copy(update={"hold_out": ((0.0, 1.0),)} if one.name in names else {}) for one in self.experiments
        ]
        return self.model_copy(update={"experiments": tuple(each)})

    def source(self, folder: Path) -> str:
        """Returns the preset that the study starts from, or the path of the file in the study's folder."""
        if self.preset in preset_names():
            return self.preset
        if not self.preset.endswith(".toml"):
            raise ConfigError(f"preset = {shown(self.preset)}: {suggest(self.preset, preset_names())}")
        return str(file_beside(folder, self.preset, "preset"))

    def worm(self, folder: Path) -> RunConfig:
        """Returns the worm that the study starts from, whose file may lie in the study's folder."""
        return load_config(self.source(folder), dict(self.set))


def load_identify_study(source: str | Path | Mapping[str, Any]) -> IdentifyStudy:
    """Loads and checks a study: a nested mapping, or the path of a TOML file.

    Raises:
        ConfigError: The file cannot be read, or a field is unknown or out of its range.
    """
    if isinstance(source, Mapping):
        check_depth(source, "the study")
        return check_section(IdentifyStudy, source)
    return check_section(IdentifyStudy, {"name": Path(source).stem, **read_toml(Path(source), "the study")})
