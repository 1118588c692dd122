"""Where the runs of a sweep are computed: this machine, the workers of a Dask scheduler, or jobs of Slurm."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from annelid.config.checking import check_section
from annelid.config.loading import read_toml
from annelid.config.sections import Section, kind_or
from annelid.errors import ConfigError

Count = Annotated[int, Field(ge=1, le=100_000)]
Retries = Annotated[int, Field(ge=0, le=100)]
_TRIED_AGAIN = "how often a run is tried again whose worker died or whose files could not be written"


class Pool(Section):
    """Plain processes of this machine, without Dask; a process that is killed ends the study."""

    kind: Literal["processes"] = "processes"
    workers: Count | None = Field(default=None, description="processes; one a core where it is left out")


class Local(Section):
    """A Dask scheduler in this process, with worker processes beside it."""

    kind: Literal["local"] = "local"
    workers: Count | None = Field(default=None, description="processes; one a core where it is left out")
    retries: Retries = Field(default=2, description=_TRIED_AGAIN)


class Scheduler(Section):
    """A Dask scheduler that is running somewhere, with the workers that have joined it."""

    kind: Literal["scheduler"] = "scheduler"
    address: str = Field(description="tcp://HOST:PORT, tls://HOST:PORT, or the path of a scheduler file (.json)")
    retries: Retries = Field(default=2, description=_TRIED_AGAIN)
    reconnect_s: Annotated[float, Field(gt=0, le=1e6)] = Field(
        default=60.0, description="how long a scheduler may be gone before the study gives up"
    )

    @model_validator(mode="after")
    def _address_of_a_scheduler(self) -> Self:
        if not is_address(self.address):
            raise ValueError(
                f"cluster.address = {self.address!r}: must be tcp://HOST:PORT, tls://HOST:PORT, or the path of a "
                "scheduler file (.json)"
            )
        return self


class Slurm(Section):
    """Jobs of Slurm, whose workers join a Dask scheduler in this process."""

    kind: Literal["slurm"] = "slurm"
    jobs: Count = Field(default=1, description="jobs that are asked for")
    cores: Count = Field(default=1, description="of each job; one worker a core")
    memory: str = Field(default="2GB", description="of each job")
    walltime: str = Field(default="01:00:00", description="of each job; a new one follows where runs are left")
    partition: str | None = Field(default=None, description="the queue")
    account: str | None = Field(default=None, description="who pays")
    directives: tuple[str, ...] = Field(default=(), description="further options of sbatch, as '--constraint=zen4'")
    prologue: tuple[str, ...] = Field(default=(), description="shell lines before the workers start, as 'module load'")
    python: str | None = Field(default=None, description="of the workers; this process' own where it is left out")
    interface: str | None = Field(default=None, description="network interface that the nodes share, as 'ib0'")
    retries: Retries = Field(default=2, description=_TRIED_AGAIN)


Cluster = Annotated[
    Annotated[Pool, Tag("processes")]
    | Annotated[Local, Tag("local")]
    | Annotated[Scheduler, Tag("scheduler")]
    | Annotated[Slurm, Tag("slurm")],
    kind_or("local"),
]
KINDS = ("processes", "local", "slurm")
"""Clusters that a word names; a scheduler is named by its address."""


class _File(Section):
    cluster: Cluster


def is_address(text: str) -> bool:
    """Whether a text is a scheduler's address, or the path of a scheduler file."""
    return text.startswith(("tcp://", "tls://", "ucx://", "ws://", "wss://")) or text.endswith(".json")


def find_cluster(text: str) -> Cluster:
    """Returns the cluster that a user names in a word.

    Args:
        text: ``processes``, ``local``, ``slurm``, a scheduler's address, the path of a scheduler file (``.json``), or
            that of a TOML file with a table ``[cluster]``.

    Raises:
        ConfigError: It is none of these, or the file is refused.
    """
    if text in KINDS:
        return check_section(_File, {"cluster": {"kind": text}}).cluster
    if is_address(text):
        return Scheduler(address=text)
    if text.endswith(".toml"):
        table = read_toml(Path(text)).get("cluster")
        if table is None:
            raise ConfigError(f"{text} names no cluster: it must have a table [cluster]")
        return check_section(_File, {"cluster": table}).cluster
    raise ConfigError(
        f"cluster {text!r}: must be one of {', '.join(KINDS)}, an address as tcp://HOST:PORT, a scheduler file (.json) "
        "or a TOML file with a table [cluster]"
    )
