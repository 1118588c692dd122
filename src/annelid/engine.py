"""Makes sure, before the engine is used for the first time, that it is one and not two in one folder."""

from __future__ import annotations

from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from annelid.errors import MixedEngine

REMEDY = "pip uninstall -y mujoco mujoco-core; pip install 'mujoco-core[rendering]>=4.0.1'"


def mixed_engine() -> str | None:
    """Says how mujoco and mujoco-core are installed over each other, as pip allows; None if they are not."""
    try:
        core, other = distribution("mujoco-core"), distribution("mujoco")
    except PackageNotFoundError:
        return None
    theirs = _hashes(other)
    differ = sorted(path for path, mark in _hashes(core).items() if theirs.get(path, mark) != mark)
    if not differ:
        return None
    return (
        f"mujoco {other.version} and mujoco-core {core.version} are installed over each other: {len(differ)} files of "
        f"one are in the other's place, such as {Path(differ[0]).name}"
    )


def refuse_mixed_engine() -> None:
    """Raises `MixedEngine`, with the line that repairs it, where two engines are installed over each other."""
    if mixed := mixed_engine():
        raise MixedEngine(f"{mixed}; repair it with: {REMEDY}")


def _hashes(installed: Distribution) -> dict[str, str]:
    """Hash of each of the engine's files in a distribution, by the path where it is installed."""
    files = installed.files or ()
    return {
        str(installed.locate_file(file)): file.hash.value for file in files if file.parts[0] == "mujoco" and file.hash
    }
