"""Tuning of an entrant on training draws: every combination of the values that its search names, the fastest wins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from annelid.config import check_section
from annelid.errors import ConfigError
from annelid.experiment import Store
from annelid.output import write_csv, write_text
from annelid.textfiles import toml_text
from annelid_studies.challenge.scores import challenge
from annelid_studies.challenge.tasks import FIRST_TEST_SEED, TUNED_AT, Entrant, trials
from annelid_studies.tables import grouped


def candidates(entrant: Entrant) -> Iterator[tuple[dict[str, float], Entrant]]:
    """Yields the values of every combination of an entrant's search, and the entrant with them."""
    for values in product(*entrant.search.values()):
        fields: dict[str, Any] = entrant.model_dump(exclude={"search"})
        chosen = dict(zip(entrant.search, values, strict=True))
        for path, value in chosen.items():
            *sections, leaf = path.split(".")
            table = fields
            for section in sections:
                inner = dict(table.get(section, {}))
                table[section] = inner
                table = inner
            table[leaf] = value
        yield chosen, check_section(Entrant, fields)


def tune_all(store: Store, entrants: Mapping[str, Entrant], seeds: Sequence[int], folder: Path) -> list[Path]:
    """Tunes those entrants that have a search, and writes each as a file that enters it, and what was tried as CSV.

    Every combination runs on training draws of level ground; runs that are refused count as standing still.

    Raises:
        ConfigError: No entrant has a search, or a seed is a test seed.
    """
    if not (searched := {name: one for name, one in entrants.items() if one.search}):
        raise ConfigError(
            f"none of {', '.join(entrants)} has a search: give values to try, as [NAME.search] in its file"
        )
    if met := [seed for seed in seeds if seed >= FIRST_TEST_SEED]:
        raise ConfigError(f"seeds {', '.join(map(str, met))} are test seeds: tune on seeds below {FIRST_TEST_SEED}")
    written = []
    for name, entrant in searched.items():
        tried = {f"{name} {i}": each for i, each in enumerate(candidates(entrant))}
        scores = challenge(
            store, trials({label: one for label, (_, one) in tried.items()}, TUNED_AT, seeds), f"tuning {name}"
        )
        of_label = grouped(scores, lambda one: one.entrant)
        speeds = {label: float(np.mean([one.speed_m_per_s for one in own])) for label, own in of_label.items()}
        ranked = sorted(speeds, key=lambda label: -speeds[label])
        best = tried[ranked[0]][1].model_dump(exclude_defaults=True)
        best["tuned_on"] = {task: list(seeds) for task in TUNED_AT}
        heading = f"{len(tried)} settings of {name} tried; this is the fastest on training draws of level ground."
        written.append(write_text(folder / f"{name}_tuned.toml", toml_text({f"{name}-tuned": best}, heading)))
        rows = ([*tried[label][0].values(), f"{speeds[label]:.5g}"] for label in ranked)
        written.append(write_csv(folder / f"{name}_tried.csv", [*entrant.search, "speed_m_per_s"], rows))
    return written
