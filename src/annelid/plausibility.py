"""What is wrong with a configuration before it runs; what each kind of body looks at is its method `findings`."""

from __future__ import annotations

from annelid.config.answers import Finding
from annelid.config.run import RunConfig
from annelid.errors import ConfigError

__all__ = ["check", "refuse_nonsense"]


def check(config: RunConfig) -> list[Finding]:
    """Checks the numbers of a configuration against one another, before anything is computed.

    Args:
        config: Any configuration.

    Returns:
        What is wrong, errors first; empty where nothing is.
    """
    first: dict[tuple[str, str], Finding] = {}
    for finding in config.body.findings(config):
        # Rings with ranges of their own may share a fault.
        first.setdefault((finding.field, finding.severity), finding)
    return sorted(first.values(), key=lambda finding: finding.severity)


def refuse_nonsense(config: RunConfig) -> tuple[str, ...]:
    """Raises `ConfigError` where `check` finds an error; returns the warnings, a sentence each."""
    found = check(config)
    errors = [str(finding) for finding in found if finding.severity == "error"]
    if errors:
        raise ConfigError(". ".join(errors))
    return tuple(map(str, found))
