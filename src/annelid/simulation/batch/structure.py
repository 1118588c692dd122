"""Which worms can be simulated in one batch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from annelid.body.worm import WormBody
from annelid.config import RunConfig, as_config
from annelid.errors import ConfigError

ALIKE = (
    "duration_s",
    "clock",
    "record",
    "controller.kind",
    "body.mesh",
    "body.formulation",
    "body.rings.kind",
    "body.rings.layout",
    "body.rings.activation_dynamics",
    "body.springs.tension_only",
    "body.springs.sensors",
)
"""What all worms of a batch must have in common; everything else may differ."""


def checked_configs(
    configs: RunConfig | str | Sequence[RunConfig | str], n_worms: int | None, seeds: Sequence[int] | None
) -> list[RunConfig]:
    """Returns the configuration of every worm of a batch.

    Args:
        configs: One configuration or name of a preset for all worms, or one for each.
        n_worms: Number of worms that share the one configuration; default: as many as there are seeds.
        seeds: A seed for each worm; default: the configurations' own, or for a shared one its own and those after it.

    Raises:
        ConfigError: The numbers of worms, configurations and seeds do not fit together, there is none, a body is
            planar, or two worms differ in a field of `ALIKE`.
    """
    if isinstance(configs, RunConfig | str | Mapping):
        shared = as_config(configs)
        n = n_worms if n_worms is not None else None if seeds is None else len(seeds)
        if n is None:
            raise ConfigError("a batch of one configuration needs n_worms or seeds")
        own = [shared] * n
        seeds = range(shared.seed, shared.seed + n) if seeds is None else seeds
    else:
        own = [as_config(one) for one in configs]
        if n_worms not in (None, len(own)):
            raise ConfigError(f"n_worms = {n_worms} does not fit {len(own)} configurations: leave it out")
    if not own:
        raise ConfigError("a batch needs at least one worm, not 0")
    if seeds is not None:
        if len(seeds) != len(own):
            raise ConfigError(f"seeds has {len(seeds)} numbers for {len(own)} worms: give one for each")
        negative = [seed for seed in seeds if seed < 0]
        if negative:
            raise ConfigError(f"seeds contains {negative[0]}: a seed must be at least 0")
        own = [one.model_copy(update={"seed": int(seed)}) for one, seed in zip(own, seeds, strict=True)]
    for one in own:
        if not isinstance(one.body, WormBody):
            raise ConfigError(f"body.kind = {one.body.kind!r} cannot be batched; only the 3D worm ('worm') can")
    _refuse_differences(own)
    return own


def _refuse_differences(configs: Sequence[RunConfig]) -> None:
    trees = [config.model_dump() for config in configs]
    for path in ALIKE:
        first = dict(_leaves(path, _at(trees[0], path)))
        for number, tree in enumerate(trees[1:], start=1):
            other = dict(_leaves(path, _at(tree, path)))
            for field in {**first, **other}:
                if first.get(field) != other.get(field):
                    raise ConfigError(
                        f"{field} is {other.get(field)!r} for worm {number} and {first.get(field)!r} for worm 0: all "
                        f"worms of a batch must agree in {', '.join(ALIKE)}; other fields may differ"
                    )


def _at(tree: Mapping[str, Any], path: str) -> Any:
    value: Any = tree
    for key in path.split("."):
        value = value.get(key)
    return value


def _leaves(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, below in value.items():
            yield from _leaves(f"{path}.{key}", below)
    else:
        yield path, value
