"""Many worms at once: all networks, then all bodies, then what each worm records; one team of worms a thread."""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from annelid.body.worm import WormBody
from annelid.config import RunConfig, as_config, field_value, fields_of
from annelid.errors import ConfigError
from annelid.protocols import Array, Sensation, State, Stateful, StridingController
from annelid.simulation.anatomy import Anatomy
from annelid.simulation.lock import locks
from annelid.simulation.loop import PROGRESS_INTERVAL_S, Loop, RecordedRun
from annelid.simulation.progress import Interruption, ProgressCallback, reporting
from annelid.simulation.runfile import FILE_NAME, Run, open_run, refuse_used_folder
from annelid.simulation.stepping import Simulation, build_controller, start
from annelid.simulation.worm import WormPlant, body_and_arena, compile_worm, owns_model

if TYPE_CHECKING:
    from annelid.control import CopySettings

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
    runs: list[RecordedRun] = []
    teams: list[Team] = []
    try:
        for numbers in np.array_split(np.arange(len(own)), threads_for(len(own), threads)):
            share = slice(int(numbers[0]), int(numbers[-1]) + 1)
            teams.append(Team(own[share], anatomies[share], folders[share], runs))
    except BaseException as error:
        for run in runs:
            run.end_with(error)
        raise
    began = perf_counter()
    with (
        reporting(progress, 0.0, own[0].duration_s) as report,
        Interruption() as interruption,
        ThreadPoolExecutor(len(teams)) as pool,
    ):
        running = left = {pool.submit(team.run, interruption) for team in teams}
        try:
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
    statuses, messages = tuple(run.status for run in runs), tuple(run.message for run in runs)
    return BatchResult(tuple(folders), statuses, messages, perf_counter() - began)


def checked_configs(
    configs: RunConfig | str | Sequence[RunConfig | str], n_worms: int | None, seeds: Sequence[int] | None
) -> list[RunConfig]:
    """Returns the configuration of every worm of a batch; takes and raises what `simulate_batch` does."""
    if isinstance(configs, RunConfig | str | Mapping):
        if n_worms is None and seeds is None:
            raise ConfigError("a batch of one configuration needs n_worms or seeds")
        shared, n = as_config(configs), n_worms if n_worms is not None else len(seeds or ())
        own, seeds = [shared] * n, range(shared.seed, shared.seed + n) if seeds is None else seeds
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
        if one.trial is not None and one.trial.push_N:
            raise ConfigError(f"trial.push_N = {one.trial.push_N:g}: worms of a batch cannot be pushed; leave it at 0")
    parts = tuple(f"{part}." for part in ALIKE)
    first, *others = (
        {path: field_value(one, path) for path in fields_of(one) if f"{path}.".startswith(parts)} for one in own
    )
    for number, other in enumerate(others, start=1):
        for field in {**first, **other}:
            if first.get(field) != other.get(field):
                raise ConfigError(
                    f"{field} is {other.get(field)!r} for worm {number} and {first.get(field)!r} for worm 0: all "
                    f"worms of a batch must agree in {', '.join(ALIKE)}; other fields may differ"
                )
    return own


def threads_for(n_worms: int, threads: int | None) -> int:
    """Returns the number of threads for a batch: no more than worms, by default one a processor."""
    if threads is not None and threads < 1:
        raise ConfigError(f"threads = {threads}: must be at least 1")
    return min(n_worms, threads or os.cpu_count() or 1)


def compile_worms(configs: Sequence[RunConfig]) -> list[Anatomy]:
    """Compiles one model for each physical configuration; returns the anatomy of every worm, as `compile_worm`."""
    models: dict[str, Anatomy] = {}
    anatomies: list[Anatomy] = []
    for config in configs:
        physical = config.model_dump_json(include={"body", "arena", "clock"}, exclude={"body": {"heading_deg"}})
        known = models.get(physical)
        if known is None:
            known = models[physical] = compile_worm(config)
        elif owns_model(config):
            body, arena = body_and_arena(config)
            known = Anatomy(copy(known.model), body, arena)
        anatomies.append(known)
    return anatomies


class Team(Loop):
    """Worms that one thread steps, from the start of the run to its end.

    The engine steps without Python's lock, so that the networks and files of one team are served while the bodies of
    another move.
    """

    flush_interval_s = 2.0
    checkpoint_interval_s = 10.0

    def __init__(
        self,
        configs: Sequence[RunConfig],
        anatomies: Sequence[Anatomy],
        folders: Sequence[Path],
        all_runs: list[RecordedRun],
    ) -> None:
        """Lays out the worms' run files and adds each run to ``all_runs`` once its file is there."""
        worms = self._worms = [WormPlant(*each) for each in zip(configs, anatomies, strict=True)]
        pairs = zip(configs, worms, strict=True)
        simulations = [start(config, worm, build_controller(config, worm), None) for config, worm in pairs]
        self._controllers = grouped(simulations)
        first = len(all_runs)
        for config, simulation, folder in zip(configs, simulations, folders, strict=True):
            all_runs.append(RecordedRun(config, simulation, folder / FILE_NAME))
        super().__init__(all_runs[first:])

    def advance(self, step: int) -> None:
        """Takes control steps up to the next one after which a body moves or something is recorded."""
        one, schedule = self._worms[next(iter(self.going))], self._schedule
        n_steps = min(one.steps_to_move(), schedule.steps_to_record(step))
        activation: dict[int, Array] = {}
        for group in tuple(self._controllers):
            of_group, errors = group.advance(n_steps)
            activation |= of_group
            for number, error in errors.items():
                self.drop(number, error)
        self.each(lambda number, run: run.simulation.check_activation(activation[number]))
        moves = one.moves_due(n_steps) > 0
        step += n_steps
        if moves or step % schedule.sample_every == 0 or step % schedule.frame_every == 0:
            self.settle()
        self.each(
            lambda number, run: run.simulation.advanced(
                self._worms[number].stride(activation[number]), activation[number][-1], step, moves
            )
        )

    def settle(self) -> None:
        """Brings every worm's own controller up to the state that the batch has reached."""
        for group in self._controllers:
            group.settle()

    def drop(self, number: int, error: Exception) -> None:
        """Ends one run because of an error, and leaves its controller out."""
        super().drop(number, error)
        for group in self._controllers:
            if number in group.rows:
                group.drop(number)
        self._controllers = [group for group in self._controllers if group.rows]


@runtime_checkable
class CopiedController(Stateful, Protocol):
    """The capability of a controller of advancing many copies of itself at once.

    Controllers that are copies of one another are ``alike``; what may differ between them is their ``own``.
    """

    alike: Hashable
    own: CopySettings

    def step_copies(
        self, states: State, sensation: Sensation, n_steps: int = 1, each: CopySettings | None = None
    ) -> tuple[State, Array]:
        """Returns the copies' states some control steps on, and all activations, ``(n_copies, n_steps, n_muscles)``."""
        ...


def grouped(simulations: Sequence[Simulation]) -> list[ControllerGroup]:
    """Groups the controllers of worms, each in its initial state: copies that are alike step together."""
    alike: dict[Hashable, list[int]] = {}
    for row, simulation in enumerate(simulations):
        controller = simulation.controller
        copied = isinstance(controller, CopiedController)
        key = (type(controller), controller.alike, simulation.is_noisy) if copied else row
        alike.setdefault(key, []).append(row)
    return [
        (Networks if isinstance(simulations[rows[0]].controller, CopiedController) else ControllerGroup)(
            rows, [simulations[row] for row in rows]
        )
        for rows in alike.values()
    ]


class ControllerGroup:
    """Controllers of some worms, ``rows``, between two events of the run; as it is, one controller of any kind."""

    def __init__(self, rows: Sequence[int], simulations: Sequence[Simulation]) -> None:
        """Takes worms that are all noisy or all not."""
        self.rows, self._simulations = list(rows), list(simulations)
        self._strides = not simulations[0].is_noisy and isinstance(simulations[0].controller, StridingController)

    def advance(self, n_steps: int) -> tuple[dict[int, Array], dict[int, Exception]]:
        """Takes control steps with the bodies at rest.

        Returns the activations of every step, ``(n_steps, n_muscles)`` each, and errors of those that fail.
        """
        steps: list[list[Array]] = []
        errors: dict[int, Exception] = {}
        try:
            if self._strides:
                observed = [simulation.sensation for simulation in self._simulations]
                return dict(zip(self.rows, self._take(observed, n_steps), strict=True)), errors
            for later in range(n_steps):
                observed = [_observed(simulation, later) for simulation in self._simulations]
                steps.append([of_one[0] for of_one in self._take(observed, 1)])
                for row, simulation, own in zip(self.rows, self._simulations, steps[-1], strict=True):
                    try:
                        simulation.check_activation(own[np.newaxis])
                    except Exception as error:
                        errors.setdefault(row, error)
                if len(errors) == len(self.rows):
                    break
        except Exception as error:
            errors = dict.fromkeys(self.rows, error)
        return {row: np.array(own) for row, own in zip(self.rows, zip(*steps, strict=False), strict=False)}, errors

    def _take(self, observed: Sequence[Sensation], n_steps: int) -> Sequence[Array]:
        """Takes control steps under what each worm observes; returns each one's activations."""
        controller = self._simulations[0].controller
        if self._strides and isinstance(controller, StridingController):
            return [np.asarray(controller.stride(observed[0], n_steps), dtype=np.float64)]
        return [np.asarray(controller.step(observed[0]), dtype=np.float64)[np.newaxis]]

    def settle(self) -> None:
        """Brings every worm's own controller up to the state that was reached; here it is the one that steps."""

    def drop(self, row: int) -> None:
        """Leaves out one worm, whose own controller keeps the state that it has reached."""
        place = self.rows.index(row)
        del self.rows[place], self._simulations[place]


_CARRIED = ("stretch_m", "stretch_rate_m_per_s")


def _observed(simulation: Simulation, later: int) -> Sensation:
    """What a worm's controller observes at a control step, so many steps after its body's last event."""
    if not later:
        return simulation.observed()
    simulation.step += 1
    simulation.sensation = simulation.sensation.later(simulation.step * simulation.schedule.timestep_s)
    return simulation.observed()


class Networks(ControllerGroup):
    """Synthetic nervous systems, as copies of one that differ in their sensors and currents only."""

    def __init__(self, rows: Sequence[int], simulations: Sequence[Simulation]) -> None:
        """Takes worms that are all noisy or all not, and whose controllers are alike."""
        super().__init__(rows, simulations)
        self._controllers = [c.controller for c in simulations if isinstance(c.controller, CopiedController)]
        self._first = self._controllers[0]
        self._strides = not simulations[0].is_noisy
        states = [controller.get_state() for controller in self._controllers]
        self._states: State = {name: np.stack([state[name] for state in states]) for name in states[0]}
        self._states["n_steps"] = states[0]["n_steps"]
        self._each = type(self._first.own).of(controller.own for controller in self._controllers)

    def _take(self, observed: Sequence[Sensation], n_steps: int) -> Sequence[Array]:
        stretch, rate = (np.stack([getattr(one, name) for one in observed]) for name in _CARRIED)
        together = replace(observed[0], stretch_m=stretch, stretch_rate_m_per_s=rate)
        self._states, activation = self._first.step_copies(self._states, together, n_steps, self._each)
        return list(activation)

    def settle(self) -> None:
        """Brings the worms' own controllers up to the state of the copies."""
        for place, controller in enumerate(self._controllers):
            controller.set_state({name: own[place] if own.ndim else own for name, own in self._states.items()})

    def drop(self, row: int) -> None:
        """Leaves out one worm, whose own controller keeps the state that it has reached."""
        self.settle()
        place = self.rows.index(row)
        super().drop(row)
        del self._controllers[place]
        self._each = type(self._first.own).of(controller.own for controller in self._controllers)
        self._states = {name: np.delete(own, place, axis=0) if own.ndim else own for name, own in self._states.items()}
