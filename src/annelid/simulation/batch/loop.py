"""The loop of a batch: all networks, then all bodies, then what each worm records; one team of worms a thread."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from annelid.config import RunConfig
from annelid.errors import ConfigError, SimulationStopped
from annelid.protocols import Array
from annelid.simulation.anatomy import Anatomy, Movement
from annelid.simulation.assemble import build_controller
from annelid.simulation.batch.body import BodyBatch, compile_worms
from annelid.simulation.batch.controllers import ControllerBatch
from annelid.simulation.batch.member import Member
from annelid.simulation.batch.structure import checked_configs
from annelid.simulation.coupling import start
from annelid.simulation.interruption import Interruption
from annelid.simulation.lock import locks
from annelid.simulation.progress import ProgressCallback, reporting
from annelid.simulation.runfile import Run, open_run, refuse_used_folder

FLUSH_INTERVAL_S = 2.0
CHECKPOINT_INTERVAL_S = 10.0
PROGRESS_INTERVAL_S = 0.2


@dataclass(frozen=True, slots=True)
class BatchResult:
    """How every worm of a batch ended; ``result[i]`` opens the run of worm ``i``.

    Attributes:
        folders: Folder of each worm's run file.
        statuses: How each ended, one of `annelid.simulation.runfile.STATUSES`.
        messages: Why it ended before its time; empty if it did not.
        wall_time_s: Wall-clock time of the whole batch without compilation, s.
    """

    folders: tuple[Path, ...]
    statuses: tuple[str, ...]
    messages: tuple[str, ...]
    wall_time_s: float

    def __len__(self) -> int:
        return len(self.folders)

    def __getitem__(self, worm: int) -> Run:
        return open_run(self.folders[worm])

    def __iter__(self) -> Iterator[Run]:
        return (self[worm] for worm in range(len(self)))

    @property
    def failed(self) -> list[int]:
        """Worms that neither completed nor were interrupted."""
        return [worm for worm, status in enumerate(self.statuses) if status not in ("complete", "interrupted")]


@locks("out")
def simulate_batch(
    configs: RunConfig | str | Sequence[RunConfig | str],
    out: str | Path,
    *,
    n_worms: int | None = None,
    seeds: Sequence[int] | None = None,
    threads: int | None = None,
    progress: bool | ProgressCallback | None = None,
    overwrite: bool = False,
) -> BatchResult:
    """Runs many 3D worms of one structure at once; each writes its own run file ``worm-000/run.nc`` and so on.

    Every variable of every file but ``wall_time`` is bit for bit that of `simulate` with the same configuration. The
    worms must agree in mesh, formulation, clock, duration, recording and kind of controller; everything else may
    differ (friction, stiffness, damping, sensors, noise, seed, guard, network). A worm whose engine, guard, controller
    or file fails ends with that status in its file, and the others go on. Checkpoints are written every ten seconds
    and at the end, so that `simulate` can continue each worm. Ctrl-C ends all as it ends a single run.

    Args:
        configs: One configuration or name of a preset for all worms, or one for each.
        out: Folder for the worms' folders; made if it is not there.
        n_worms: Number of worms that share the one configuration; default: as many as there are seeds.
        seeds: A seed for each worm; default: the configurations' own, or for a shared one its own and those after it.
        threads: Threads that step the bodies; default: as many as there are processors to use.
        progress: As for `simulate`; one for the whole batch.
        overwrite: Allow worms' folders that are not empty, and replace their run files.

    Returns:
        How every worm ended.

    Raises:
        ConfigError: Worms that do not fit into one batch, numbers that do not fit together, or a folder in use.
        RunFileError: A run file cannot be made, or another process writes into the folder; then nothing is simulated.
        KeyboardInterrupt: A second Ctrl-C; all files are closed.
    """
    own = checked_configs(configs, n_worms, seeds)
    folders = [Path(out) / f"worm-{number:03d}" for number in range(len(own))]
    for folder in folders:
        refuse_used_folder(folder, overwrite)
    anatomies = compile_worms(own)
    members: list[Member] = []
    teams: list[_Team] = []
    try:
        for numbers in np.array_split(np.arange(len(own)), threads_for(len(own), threads)):
            share = slice(int(numbers[0]), int(numbers[-1]) + 1)
            team = _Team(own[share], anatomies[share], folders[share], members)
            teams.append(team)
    except BaseException as error:
        for member in members:
            member.end_with(error)
        raise
    with reporting(progress, 0.0, own[0].duration_s) as report:
        wall_time_s = _run_all(teams, report)
    return BatchResult(
        tuple(folders),
        tuple(member.status for member in members),
        tuple(member.message for member in members),
        wall_time_s,
    )


def _run_all(teams: Sequence[_Team], report: ProgressCallback | None) -> float:
    """Runs every team in a thread of its own to the end; returns the wall-clock time, s."""
    began = perf_counter()
    with Interruption() as interruption, ThreadPoolExecutor(len(teams)) as pool:
        running = {pool.submit(team.run, began, interruption) for team in teams}
        try:
            left = running
            while left:
                _, left = wait(left, PROGRESS_INTERVAL_S)
                if report is not None:
                    report(min(team.simulated_s for team in teams), perf_counter() - began)
        except BaseException:
            # The executor waits for the teams, which end in good order once they are asked to.
            interruption.requested = interruption.requested or "an error"
            raise
        for team in running:
            team.result()
    return perf_counter() - began


def threads_for(n_worms: int, threads: int | None) -> int:
    """Returns the number of threads for a batch: no more than worms, by default one a processor.

    Raises:
        ConfigError: Less than one.
    """
    if threads is not None and threads < 1:
        raise ConfigError(f"threads = {threads}: must be at least 1")
    return min(n_worms, threads or os.cpu_count() or 1)


class _Team:
    """Worms that one thread steps, from the start of the run to its end.

    The engine steps without Python's lock, so that the networks and files of one team are served while the bodies of
    another move.
    """

    def __init__(
        self,
        configs: Sequence[RunConfig],
        anatomies: Sequence[Anatomy],
        folders: Sequence[Path],
        all_members: list[Member],
    ) -> None:
        """Lays out the worms' run files and adds each worm to ``all_members`` once its file is there.

        Raises:
            ConfigError: Worms that do not fit into one batch.
            RunFileError: A run file cannot be made.
        """
        self._bodies = BodyBatch(configs, anatomies)
        couplings = [
            start(config, worm, build_controller(config, worm), None)
            for config, worm in zip(configs, self._bodies.worms, strict=True)
        ]
        self._controllers = ControllerBatch(configs, couplings)
        self._members: list[Member] = []
        for config, coupling, worm, folder in zip(configs, couplings, self._bodies.worms, folders, strict=True):
            member = Member(len(self._members), config, coupling, worm, folder)
            self._members.append(member)
            all_members.append(member)
        self._rows = list(range(len(self._members)))
        self._schedule = couplings[0].schedule
        self._step = 0
        self._began = 0.0
        self._next: dict[str, float] = {}

    @property
    def simulated_s(self) -> float:
        """How far the team has come, s; a team whose worms have all ended has come to the end."""
        return (self._step if self._rows else self._schedule.end) * self._schedule.timestep_s

    def run(self, began: float, interruption: Interruption) -> None:
        """Runs to the end and sees to it that every file says how its worm ended."""
        self._began = began
        self._next = dict.fromkeys(("flush", "checkpoint"), began)
        try:
            self._each(lambda member: member.record(0.0))
            while self._rows and self._step < self._schedule.end and interruption.requested is None:
                self._advance(self._steps_to_event())
                self._write_what_is_due()
            self._controllers.settle()
            early = self._step < self._schedule.end
            self._each(lambda member: member.finish(interruption.requested if early else None))
        except BaseException as error:
            for row in self._rows:
                self._members[row].end_with(error)
            raise

    def _steps_to_event(self) -> int:
        """Control steps up to the next one after which a body moves, something is recorded, or the run ends."""
        return min(self._members[self._rows[0]].worm.steps_to_move(), self._schedule.steps_to_record(self._step))

    def _advance(self, n_steps: int) -> None:
        """Takes control steps, at whose end the bodies may move, and records what is due then."""
        activation, errors = self._controllers.advance(n_steps)
        self._drop(errors)
        self._each(lambda member: member.coupling.check_activation(activation[member.row]))
        moved = self._move(n_steps, activation)
        self._step += n_steps
        schedule = self._schedule
        due = self._step % schedule.sample_every == 0 or self._step % schedule.frame_every == 0
        if moved or due:
            self._controllers.settle()
        wall_time_s = perf_counter() - self._began
        self._each(lambda member: member.advance(n_steps, self._step, activation[member.row], moved.get(member.row)))
        if due:
            self._each(lambda member: member.record(wall_time_s))

    def _move(self, n_steps: int, activation: Mapping[int, Array]) -> dict[int, Movement]:
        """Moves the bodies if they are due to move; returns what each of those that could be moved has come to."""
        if not self._rows:
            return {}
        due = self._members[self._rows[0]].worm.moves_due(n_steps)
        if not due:
            return {}
        stacked = np.stack([activation[row] for row in self._rows])
        reasons = self._bodies.move(self._rows, stacked, due)
        self._drop({row: SimulationStopped(reason) for row, reason in reasons.items()})
        return dict(zip(self._rows, self._bodies.moved(self._rows), strict=True))

    def _write_what_is_due(self) -> None:
        """Hands samples to the files and writes checkpoints, each at its interval."""
        now = perf_counter()
        if now >= self._next["flush"]:
            self._each(lambda member: member.flush())
            self._next["flush"] = now + FLUSH_INTERVAL_S
        if now >= self._next["checkpoint"]:
            self._controllers.settle()
            self._each(lambda member: member.checkpoint())
            self._next["checkpoint"] = perf_counter() + CHECKPOINT_INTERVAL_S

    def _each(self, action: Callable[[Member], None]) -> None:
        """Does something with every worm that is still running; one that fails ends, and the others go on."""
        errors: dict[int, Exception] = {}
        for row in self._rows:
            try:
                action(self._members[row])
            except Exception as error:
                errors[row] = error
        self._drop(errors)

    def _drop(self, errors: Mapping[int, Exception]) -> None:
        for row, error in errors.items():
            self._members[row].end_with(error)
            self._controllers.drop(row)
            self._rows.remove(row)
