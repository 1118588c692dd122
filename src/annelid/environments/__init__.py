"""Worms as Gymnasium environments (extra ``gym``).

Importing this module registers them, which Gymnasium can do itself (``"annelid.environments:annelid/Worm-v0"``)::

    import gymnasium
    import annelid.environments

    env = gymnasium.make("annelid/Worm-v0")
    many = gymnasium.make_vec("annelid/Worm-v0", num_envs=8, vectorization_mode="async")
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from annelid.errors import MissingDependency
from annelid.lazy import lazy

if TYPE_CHECKING:
    from annelid.environments.observation import Layout
    from annelid.environments.single import WormEnv
    from annelid.environments.task import WEIGHTS

NAMESPACE = "annelid"
PIPE_EPISODE_S = 60.0
ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "Worm-v0": {},
    "WormPipe-v0": {"arena": "pipe.taper", "episode_s": PIPE_EPISODE_S},
}
"""Names within the namespace, and what they set beyond the defaults of `WormEnv`."""

__all__ = ["ENVIRONMENTS", "WEIGHTS", "Layout", "WormEnv"]

try:
    from gymnasium.envs.registration import register
except ImportError:
    raise MissingDependency("environments need gymnasium: install it with  pip install 'annelid[gym]'") from None

for _name, _kwargs in ENVIRONMENTS.items():
    register(f"{NAMESPACE}/{_name}", entry_point="annelid.environments.single:WormEnv", kwargs=_kwargs)

__getattr__, __dir__ = lazy(
    __name__,
    {
        "Weights": "WEIGHTS has the usual weights by name",
        "WormVectorEnv": "make many worms with gymnasium.make_vec or gymnasium.vector.AsyncVectorEnv",
    },
)
