"""A user's own controller by the name ``module:name``, as a kind that worker processes of the same machine know too.

Only a person names it: on the command line, or in the environment that annelid is started in. A configuration that is
read from a file can choose it once it is known, and cannot make it known.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

from pydantic import create_model

from annelid.config.run import ControllerKind, RunConfig
from annelid.control.base import CallableController
from annelid.errors import ConfigError, shown
from annelid.protocols import Controller, Plant

VARIABLE = "ANNELID_CONTROLLERS"
"""Environment variable with the names of controllers that are made known, separated by commas."""


class OwnController(ControllerKind):
    """Base of the kinds that `own_controller` makes; they have no fields."""

    made: ClassVar[Callable[..., Any]]

    def build(self, config: RunConfig, plant: Plant) -> Controller:
        """Builds the controller, as `ControllerKind.build`: of a class, ``made(n_segments, n_muscles)``."""
        made = type(self).made
        if isinstance(made, type):
            return cast(Controller, made(plant.n_segments, plant.n_muscles))
        return CallableController(made, plant.n_muscles)


def own_controller(name: str) -> str:
    """Makes a controller of a user's own known as a kind, in this process and in those that it starts.

    Args:
        name: ``module:name``. The name is of a function from sensation to activation; of a class with ``reset`` and
            ``step`` that is made with the numbers of segments and of muscles; or of a subclass of
            `annelid.config.ControllerKind`. The module is found as Python finds it, or in the working directory.

    Returns:
        What ``controller.kind`` is then: the same text, or the name that a subclass has.

    Raises:
        ConfigError: There is no such module, it cannot be imported, or what it has under the name is none of these.
    """
    module_name, _, attribute = name.partition(":")
    if not module_name or not attribute.isidentifier():
        raise ConfigError(f"controller {shown(name)}: write module:name, as mine:Controller for a class in mine.py")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        module = import_module(module_name)
    except Exception as error:
        raise ConfigError(f"controller {shown(name)}: {module_name} cannot be imported: {error}") from None
    found: Any = getattr(module, attribute, None)
    if found is None:
        raise ConfigError(f"controller {shown(name)}: {module_name} has nothing of that name")
    if isinstance(found, type) and issubclass(found, ControllerKind):
        kind: str = found.model_fields["kind"].default
    elif callable(found) and (not isinstance(found, type) or (hasattr(found, "reset") and hasattr(found, "step"))):
        kind = name
        # In a worker this runs while the package of controllers is imported.
        if not ControllerKind.registry.has(kind):
            fields: dict[str, Any] = {"kind": (Literal[name], name)}
            own = create_model(found.__name__, __base__=OwnController, __module__=module_name, **fields)
            own.made = staticmethod(found)
    else:
        raise ConfigError(
            f"controller {shown(name)} must be a function of the sensation, a class with reset and step, or a "
            "subclass of annelid.config.ControllerKind"
        )
    os.environ[VARIABLE] = ",".join(dict.fromkeys([*_named(), name]))
    return kind


def _named() -> list[str]:
    return [name for name in os.environ.get(VARIABLE, "").split(",") if name]


for _name in _named():
    try:
        own_controller(_name)
    except ConfigError as _error:
        warnings.warn(f"{VARIABLE}: {_error}", stacklevel=1)
