"""Where the runs of a sweep are computed: this machine, the workers of a Dask scheduler, or jobs of Slurm.

A scheduler runs code here, and a job of Slurm is a shell script: a cluster that a file describes is used only where the
user names that file (`find_cluster`), and what goes into a script is checked word by word.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from annelid.config.checking import check_section
from annelid.config.sections import Section
from annelid.errors import ConfigError, shown
from annelid.textfiles import read_json, read_toml

Count = Annotated[int, Field(ge=1, le=100_000)]
Retries = Annotated[int, Field(ge=0, le=100)]
_SCHEMES = ("tcp://", "tls://", "ucx://", "ws://", "wss://")
_TRIED_AGAIN = "how often a run is tried again whose worker died or whose files could not be written"


def _written(pattern: str, form: str) -> AfterValidator:
    """Refuses text of any other form, line breaks and other control characters always."""

    def check(text: str) -> str:
        if re.fullmatch(pattern, text) is None or not text.isprintable():
            raise ValueError(f"must be {form}")
        return text

    return AfterValidator(check)


_Name = Annotated[str, _written(r"\w[\w.,@+-]*", "a name of letters, digits and . , @ + - _")]
_Memory = Annotated[str, _written(r"\d{1,6}(\.\d{1,3})? ?[kKMGT]?i?B", "a number and B, kB, MB, GB or TB, as '2GB'")]
_Walltime = Annotated[
    str,
    _written(
        r"(\d{1,3}-)?\d{1,4}:[0-5]\d:[0-5]\d", "HOURS:MINUTES:SECONDS or DAYS-HOURS:MINUTES:SECONDS, as '04:00:00'"
    ),
]
_Program = Annotated[str, _written(r"[\w./~][\w./~+-]*", "the path of a program, of letters, digits and . / ~ + - _")]
_Option = Annotated[str, _written(r"--?[A-Za-z][^\\`$;&|<>]*", "an option of sbatch, as '--constraint=zen4'")]
_Line = Annotated[str, _written(r".*", "one line of shell")]


class Pool(Section):
    """Processes of this machine; one that is killed is replaced. `local` is an older name of the same."""

    kind: Literal["processes", "local"] = "processes"
    workers: Count | None = Field(default=None, description="processes; one a core where it is left out")
    retries: Retries = Field(default=2, description=_TRIED_AGAIN)

    def __str__(self) -> str:
        """Says in a few words where runs would be computed."""
        return f"{self.workers or 'as many as cores'} processes of this machine"


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
        if not (is_address(self.address) and self.address.isprintable()):
            raise ValueError(
                f"cluster.address = {shown(self.address)}: must be tcp://HOST:PORT, tls://HOST:PORT, or the path of a "
                "scheduler file (.json)"
            )
        return self

    def found(self) -> str:
        """Returns the address of the scheduler, read from its file where it has one.

        Raises:
            ConfigError: There is no such file, or it names no scheduler.
        """
        if self.address.startswith(_SCHEMES):
            return self.address
        content = read_json(Path(self.address), "the scheduler file")
        address = content.get("address") if isinstance(content, dict) else None
        if not (isinstance(address, str) and address.startswith(_SCHEMES)):
            raise ConfigError(
                f"the scheduler file {self.address} has address = {shown(address)}: must be tcp://HOST:PORT or "
                "tls://HOST:PORT; name the file that  dask scheduler --scheduler-file  writes"
            )
        return check_section(Scheduler, {"address": address}).address

    def __str__(self) -> str:
        """Says in a few words where runs would be computed."""
        return f"scheduler {self.address}"


class Slurm(Section):
    """Jobs of Slurm, whose workers join a Dask scheduler in this process."""

    kind: Literal["slurm"] = "slurm"
    jobs: Count = Field(default=1, description="jobs that are asked for")
    cores: Count = Field(default=1, description="of each job; one worker a core")
    memory: _Memory = Field(default="2GB", description="of each job")
    walltime: _Walltime = Field(default="01:00:00", description="of each job; a new one follows where runs are left")
    partition: _Name | None = Field(default=None, description="the queue")
    account: _Name | None = Field(default=None, description="who pays")
    directives: tuple[_Option, ...] = Field(default=(), description="further options of sbatch, as '--constraint=zen4'")
    prologue: tuple[_Line, ...] = Field(
        default=(), description="shell lines before the workers start, as 'module load'"
    )
    python: _Program | None = Field(default=None, description="of the workers; this process' own where it is left out")
    interface: _Name | None = Field(default=None, description="network interface that the nodes share, as 'ib0'")
    retries: Retries = Field(default=2, description=_TRIED_AGAIN)

    def __str__(self) -> str:
        """Says in a few words where runs would be computed."""
        return f"{self.jobs} jobs of Slurm" + (
            f" that run {len(self.prologue)} lines of shell" if self.prologue else ""
        )


def _kind_of(value: Any) -> Any:
    return value.get("kind", "processes") if isinstance(value, Mapping) else getattr(value, "kind", "processes")


Cluster = Annotated[
    Annotated[Pool, Tag("processes")]
    | Annotated[Pool, Tag("local")]
    | Annotated[Scheduler, Tag("scheduler")]
    | Annotated[Slurm, Tag("slurm")],
    Discriminator(_kind_of),
]
KINDS = ("processes", "local", "slurm")
"""Clusters that a word names; a scheduler is named by its address."""


class _File(Section):
    cluster: Cluster


def is_address(text: str) -> bool:
    """Whether a text is a scheduler's address, or the path of a scheduler file."""
    return text.startswith(_SCHEMES) or text.endswith(".json")


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
        return check_section(_File, {"cluster": {"kind": "scheduler", "address": text}}).cluster
    if text.endswith(".toml"):
        table = read_toml(Path(text)).get("cluster")
        if table is None:
            raise ConfigError(f"{text} names no cluster: it must have a table [cluster]")
        return check_section(_File, {"cluster": table}).cluster
    raise ConfigError(
        f"cluster {text!r}: must be one of {', '.join(KINDS)}, an address as tcp://HOST:PORT, a scheduler file (.json) "
        "or a TOML file with a table [cluster]"
    )
