"""What is varied: fields of a configuration, each in a range or among choices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from annelid.config import RunConfig, field_value, fields_of, load_config, parse_assignments
from annelid.errors import ConfigError, suggest
from annelid.experiment.space import Choice, Interval, Variable, interval

LOG = "log"
HOW = "give FIELD=LOW:HIGH, FIELD=LOW:HIGH:log or FIELD=VALUE,VALUE,.."


def default_variables(config: RunConfig) -> list[Variable]:
    """Returns the variables of a configuration's controller.

    Raises:
        ConfigError: The controller has no timing of its own to vary.
    """
    kind, tuned = config.controller.kind, config.controller.tuned
    if not tuned:
        raise ConfigError(f"controller.kind = {kind!r} has no fields that are varied by default: {HOW} with --vary")
    return [parse_variable(text, config) for text in tuned]


def variables_of(texts: Sequence[str], config: RunConfig) -> list[Variable]:
    """Reads what is varied, each ``FIELD=LOW:HIGH[:log]`` or ``FIELD=VALUE,VALUE,..``; by default the controller's.

    Raises:
        ConfigError: A malformed text, an unknown field, a value out of the field's range, or a field given twice.
    """
    variables = [parse_variable(text, config) for text in texts] or default_variables(config)
    fields = [variable.field for variable in variables]
    for field in fields:
        if fields.count(field) > 1:
            raise ConfigError(f"{field} is varied twice: {HOW} once for each field")
    return variables


def parse_variable(text: str, config: RunConfig) -> Variable:
    """Reads one variable.

    Args:
        text: ``FIELD=LOW:HIGH`` or ``FIELD=LOW:HIGH:log`` for a number, whole where the field's own value is;
            ``FIELD=VALUE,VALUE,..`` for choices, each as TOML or plain text.
        config: The configuration that the fields are of.

    Raises:
        ConfigError: The text is malformed, there is no such field, or a value is out of the field's range.
    """
    field, equals, right = (part.strip() for part in text.partition("="))
    if not equals or not right:
        raise ConfigError(f"{text!r} says nothing to vary: {HOW}")
    known = fields_of(config)
    if field not in known:
        raise ConfigError(f"unknown field {field!r}: {suggest(field, known)}")
    variable = _choice(field, right) if ":" not in right else _interval(field, right, field_value(config, field))
    for end in variable.values if isinstance(variable, Choice) else (variable.low, variable.high):
        load_config(config.model_dump(), {field: int(end) if getattr(variable, "whole", False) else end})
    return variable


def _choice(field: str, text: str) -> Choice:
    # As TOML: brackets of a list keep its commas together.
    listed = parse_assignments([f"{field}=[{text}]"])[field]
    values = listed if isinstance(listed, list) else [word.strip() for word in text.split(",")]
    if len(values) < 2:
        raise ConfigError(f"{field}={text}: one value is no choice: {HOW}")
    return Choice(field, tuple(values))


def _interval(field: str, text: str, present: Any) -> Interval:
    low_text, high_text, *rest = (part.strip() for part in text.split(":"))
    try:
        low, high = float(low_text), float(high_text)
    except ValueError:
        raise ConfigError(f"{field}={text}: the ends of a range must be numbers: {HOW}") from None
    if rest not in ([], [LOG]):
        raise ConfigError(f"{field}={text}: only 'log' may follow the ends of a range: {HOW}")
    if not low < high:
        raise ConfigError(f"{field}={text}: the lower end must be below the upper end")
    if rest and low <= 0.0:
        raise ConfigError(f"{field}={text}: a logarithmic range needs a lower end above 0")
    return interval(field, low, high, present, logarithmic=bool(rest))


def own_values(config: RunConfig, variables: Sequence[Variable]) -> dict[str, Any] | None:
    """Returns the configuration's own values of the variables by field; None if one is outside of what it may be."""
    own = {variable.field: field_value(config, variable.field) for variable in variables}
    return own if all(own[variable.field] in variable for variable in variables) else None
