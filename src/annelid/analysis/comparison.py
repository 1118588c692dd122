"""Runs side by side: numbers, differences to the first run, and the fields in which they are configured unlike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from annelid.analysis.numbers import Value
from annelid.analysis.summary import NUMBERS, summary
from annelid.config import RunConfig, field_value, fields_of
from annelid.control.network_file import differing_networks
from annelid.simulation.runfile import Run

COMPARED = tuple(name for name, one in NUMBERS.items() if one.in_sweeps and name not in ("n_segments", "wave"))
"""Numbers that are laid side by side."""
# Fields of the configuration that change nothing in a run.
_WORDS = ("name", "summary", "published")

LACKING: Any = object()  # stands for the value of a field that a kind of worm does not have


@dataclass(frozen=True, slots=True)
class Comparison:
    """What several runs have come to."""

    labels: tuple[str, ...]  # a short distinct name for each run
    paths: tuple[str, ...]
    statuses: tuple[str, ...]
    orders: tuple[tuple[int, ...], ...]  # segments (from 1) in the order of their contractions
    numbers: Mapping[str, tuple[Value, ...]]  # by name, SI units
    fields: Mapping[str, tuple[Any, ...]]  # of the configuration in which they differ
    network: Mapping[str, tuple[Any, ...]] | None = None  # the same of networks, where one is from a file

    def differences(self, field: str) -> list[Value]:
        """Returns the `relative_difference` of each run's number to the first run's; None for the first."""
        first, *others = self.numbers[field]
        return [None, *(relative_difference(first, other) for other in others)]

    def to_dict(self) -> dict[str, Any]:
        """Returns plain lists, numbers, strings and None, ready for JSON."""
        runs = zip(self.labels, self.paths, self.statuses, map(list, self.orders), strict=True)
        return {
            "runs": [dict(zip(("label", "path", "status", "order"), run, strict=True)) for run in runs],
            "numbers": {
                field: {"values": list(values), "differences": self.differences(field)}
                for field, values in self.numbers.items()
            },
            "configuration": {field: [_plain(value) for value in values] for field, values in self.fields.items()},
            "network": {field: [_plain(value) for value in values] for field, values in (self.network or {}).items()},
        }


def compare(runs: Sequence[Run]) -> Comparison:
    """Lays runs of any kinds of worm side by side; the first is what the others are compared with."""
    summaries = [summary(run) for run in runs]
    return Comparison(
        labels=run_labels(runs),
        paths=tuple(str(run.path) for run in runs),
        statuses=tuple(run.status for run in runs),
        orders=tuple(tuple(one.order) for one in summaries),
        numbers={name: tuple(getattr(one, name) for one in summaries) for name in COMPARED},
        fields=differing_fields([run.config for run in runs]),
        network=differing_networks([run.config for run in runs], LACKING),
    )


def run_labels(runs: Sequence[Run]) -> tuple[str, ...]:
    """Returns a short distinct name for each run: its folder's name, or as much of its path as makes it distinct."""
    parts = [run.path.absolute().parent.parts for run in runs]
    for depth in range(1, max(map(len, parts)) + 1):
        labels = tuple("/".join(part[-depth:]) for part in parts)
        if len(set(labels)) == len(labels):
            return labels
    return tuple(f"{part[-1]} ({number})" for number, part in enumerate(parts, start=1))


def relative_difference(first: Value, other: Value) -> Value:
    """Returns ``(other - first) / |first|``, by segment; None where either is None, the first 0, or lengths differ."""
    if first is None or other is None:
        return None
    if isinstance(first, Sequence) or isinstance(other, Sequence):
        if not (isinstance(first, Sequence) and isinstance(other, Sequence)) or len(first) != len(other):
            return None
        shares = [relative_difference(a, b) for a, b in zip(first, other, strict=True)]
        return [share for share in shares if not isinstance(share, Sequence)]
    return (other - first) / abs(first) if first else None


def differing_fields(configs: Sequence[RunConfig]) -> dict[str, tuple[Any, ...]]:
    """Finds the fields in which configurations differ: values by dotted path, `LACKING` where there is none."""
    own = [fields_of(config) for config in configs]
    fields = {}
    for path in dict.fromkeys(path for each in own for path in each if path not in _WORDS):
        pairs = zip(configs, own, strict=True)
        values = tuple(field_value(config, path) if path in each else LACKING for config, each in pairs)
        if any(value != values[0] for value in values):
            fields[path] = values
    return fields


def _plain(value: Any) -> Any:
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if value is LACKING else value
