"""Trains the network of controller kind `policy` by reinforcement learning: soft actor-critic of Stable-Baselines3.

An episode is one training draw of one of the tasks `TASKS`, in the Gymnasium environment of the body with longer steps
than the benchmark's, which judges what was learned. The reward is the way that the worm comes. From random weights, no
gait was found in 2,000 steps, so the actor first imitates waves by the clock. Training goes piece by piece: each has
its own random numbers and ends in a checkpoint, so an interrupted training ends with the same bits as another.
"""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from annelid.errors import ConfigError, MissingDependency, suggest

try:
    sb3: Any = import_module("stable_baselines3")
    torch: Any = import_module("torch")
except ImportError:
    raise MissingDependency("training needs Stable-Baselines3: install it with  pip install 'annelid[learn]'") from None

import gymnasium
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from annelid.config import load_config
from annelid.draw import canvas, panel_title, save_both, segment_colors
from annelid.environments import WormEnv
from annelid.experiment import StudyProgress
from annelid.output import write_csv, write_text
from annelid.protocols import Array
from annelid_studies.challenge.tasks import FIRST_TEST_SEED, Entrant, all_tasks
from annelid_studies.challenge.tuning import write_entrants
from annelid_studies.policy import LARGEST, STRETCH_M, Policy, inputs
from annelid_studies.tables import grouped

TASKS = ("level", "friction", "slope")
SEED = 0
EVALUATED = 0
"""Training seed of the draws on which every piece's network is judged."""
INTERVAL_S = {"three": 0.08, "six": 0.12}
TRAINED_ON: Mapping[str, tuple[str, str | None]] = {
    "three": ("riddle2023-rods-coarse", None),
    "six": ("riddle2025", "coarse"),
}
"""Preset and level that stand for each of the bodies of the benchmark in training."""
EPISODE_STEPS = 80
PIECE = 2000
"""Environment steps of a piece."""
WAVES, SLOWER, WAVE_NOISE = 12, 0.3, 0.2
"""Waves that are shown; their times are those of `WAVE` times exp(-SLOWER) .. exp(SLOWER); noise on actions."""
WAVE = {
    "three": {"rise_s": 0.16, "hold_s": 0.05, "fall_s": 0.16, "interval_s": 0.27},
    "six": {"rise_s": 0.48, "hold_s": 0.18, "fall_s": 0.11, "interval_s": 0.26},
}
IMITATION, CRITIC_FIRST = 2000, 1000
"""Steps of gradient descent of the actor on the best waves, and of the critic before the actor learns by itself."""
LOG_NOISE = -1.5
"""Logarithm of the exploration's standard deviation at the beginning, before the output's tanh."""
INSIDE = 0.999
"""Largest action of a wave; the learner takes the inverse of the output's tanh."""
HIDDEN = 16
REWARD = 10.0
"""What a body length per second is rewarded with."""
DIGITS = 5
"""Significant digits of weights."""
OPTIONS: Mapping[str, Any] = {
    "learning_rate": 5e-4,
    "learning_starts": 0,
    "batch_size": 256,
    "tau": 0.02,
    "gamma": 0.97,
    "train_freq": 8,
    "gradient_steps": 8,
    "ent_coef": "auto_0.01",
}
"""Of `stable_baselines3.SAC`."""
CRITIC = (64, 64)
ARRAYS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


@dataclass(frozen=True, slots=True)
class Piece:
    """What a piece of training led to."""

    body: str
    steps: int  # of the environment, so far
    training_m_per_s: float  # mean speed of its episodes
    level_m_per_s: float  # speed of the network at its end, without noise, on the draw of seed `EVALUATED`
    friction_m_per_s: float
    slope_m_per_s: float

    @property
    def speed_m_per_s(self) -> float:
        """Mean over tasks, by which the best network is chosen."""
        return (self.level_m_per_s + self.friction_m_per_s + self.slope_m_per_s) / len(TASKS)


class PolicyEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A body of the benchmark that senses and does what a policy does, with a training draw for each episode.

    Attributes:
        speeds_m_per_s: Mean speed of every episode that has ended.
    """

    def __init__(self, body: str) -> None:
        """Takes the name of the body."""
        (self._preset, self._fidelity), self._interval_s = TRAINED_ON[body], INTERVAL_S[body]
        self.speeds_m_per_s: list[float] = []
        self.begin(TASKS[0], EVALUATED)
        n = self.n_segments = self._env.worm.n_segments
        self.touch_N = float(f"{self._env.worm.total_mass_kg * 9.81 / n:.2g}")
        self.observation_space = Box(-LARGEST, LARGEST, (3 * n,), np.float32)
        self.action_space = Box(-1.0, 1.0, (n,), np.float32)

    def begin(self, task: str, seed: int) -> None:
        """Begins an episode of a draw, with a relaxed worm."""
        shared = {**all_tasks().set, **all_tasks().tasks[task].set, **all_tasks().drawn(task, seed)}
        arena = {field: value for field, value in shared.items() if field.startswith("arena.")}
        self._env = WormEnv(
            self._preset,
            arena,
            fidelity=self._fidelity,
            interval_s=self._interval_s,
            episode_s=EPISODE_STEPS * self._interval_s,
            weights={"progress": REWARD, "effort": 0.0, "slip": 0.0, "failure": REWARD},
            start_activation=0.0,
        )
        self._env.reset()
        self._last = np.zeros(self._env.worm.n_segments)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode of a task and a training seed that are drawn."""
        super().reset(seed=seed)
        self.begin(str(self.np_random.choice(TASKS)), int(self.np_random.integers(FIRST_TEST_SEED)))
        return self.read().astype(np.float32), {}

    def read(self) -> Array:
        """Returns what a policy reads now."""
        return inputs(self._env.sensation, self._last, STRETCH_M, self.touch_N)

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Goes on by one interval; actions from -1 to 1 are activations from 0 to 1."""
        self._last = np.clip(0.5 * (1.0 + np.asarray(action, dtype=float)), 0.0, 1.0)
        asked = self._last.repeat(self._env.worm.n_muscles // self.n_segments)
        _, reward, terminated, truncated, info = self._env.step(asked)
        if terminated or truncated:
            self.speeds_m_per_s.append(info["travel"] * self._env.worm.geometry.length_m / info["time_s"])
        return self.read().astype(np.float32), float(reward), terminated, truncated, {}

    def speed_m_per_s(self, policy: Policy, task: str, seed: int) -> float:
        """Returns how fast a policy is on a draw; 0 where the simulation breaks down."""
        self.begin(task, seed)
        over = late = False
        while not (over or late):
            *_, over, late, _ = self.step(2.0 * policy.activation(self.read()) - 1.0)
        reached = self.speeds_m_per_s.pop()
        return 0.0 if over else reached


class Learner:
    """The training of a policy for one body, kept in a folder.

    Attributes:
        pieces: What was learned so far.
        best: Fields of the best network so far.
    """

    def __init__(self, body: str, folder: Path) -> None:
        """Begins, or goes on from the checkpoint in the folder."""
        torch.set_num_threads(1)
        self._env, self._body, self._folder = PolicyEnv(body), body, folder
        self._envs = sb3.common.vec_env.DummyVecEnv([lambda: self._env])
        actor = {"net_arch": {"pi": [HIDDEN], "qf": [*CRITIC]}, "activation_fn": torch.nn.Tanh}
        self._model = sb3.SAC("MlpPolicy", self._envs, seed=SEED, device="cpu", policy_kwargs=actor, **OPTIONS)
        self._model.set_logger(sb3.common.logger.Logger(None, []))
        self.pieces: list[Piece] = []
        self.best: dict[str, Any] = {}
        if saved := _checkpoints(folder):
            self._load(saved[-1])

    def learn(self, n_steps: int) -> Iterator[Piece]:
        """Goes on until so many steps of the environment are made; gives each piece when its checkpoint is written."""
        if not self.pieces and self._model.num_timesteps == 0:
            self._imitate()
            self._judge(float("nan"))
            yield self.pieces[-1]
        while (done := self._model.num_timesteps) < n_steps:
            self._model.set_env(self._envs, force_reset=True)
            self._model.set_random_seed(SEED + 1 + done)
            self._env.speeds_m_per_s.clear()
            self._model.learn(min(PIECE, n_steps - done), reset_num_timesteps=False)
            self._judge(float(np.mean(self._env.speeds_m_per_s or [np.nan])))
            yield self.pieces[-1]

    def _judge(self, training_m_per_s: float) -> None:
        """Ends a piece: runs the network as it is now, without noise, and writes a checkpoint."""
        fields = self.fields()
        policy = Policy.model_validate(fields)
        speeds = [self._env.speed_m_per_s(policy, task, EVALUATED) for task in TASKS]
        piece = Piece(
            self._body, self._model.num_timesteps, *(round(speed, 6) for speed in (training_m_per_s, *speeds))
        )
        if all(piece.speed_m_per_s > one.speed_m_per_s for one in self.pieces):
            self.best = fields
        self.pieces.append(piece)
        self._save()

    def fields(self) -> dict[str, Any]:
        """Returns the fields of the present network."""
        actor = self._model.policy.actor
        hidden, output = actor.latent_pi[0], actor.mu
        return {
            "interval_s": INTERVAL_S[self._body],
            "stretch_m": STRETCH_M,
            "touch_N": self._env.touch_N,
            "hidden": _rounded(hidden.weight),
            "hidden_bias": _rounded(hidden.bias),
            "output": _rounded(output.weight),
            "output_bias": _rounded(output.bias),
        }

    def _imitate(self) -> None:
        """Lets waves by the clock walk, with noise; the actor imitates the best, the critic learns from all."""
        rng, env, n = np.random.default_rng(SEED), self._env, self._env.n_segments
        shown: list[tuple[float, list[tuple[NDArray[Any], Array]]]] = []
        for seed in range(WAVES):
            slower = float(np.exp(rng.uniform(-SLOWER, SLOWER)))
            times = {name: slower * value for name, value in WAVE[self._body].items()}
            wave: Any = load_config(
                all_tasks().bodies[self._body].preset, {"controller": {"kind": "timed", **times}}
            ).controller
            env.begin(TASKS[0], seed)
            before: NDArray[Any] = env.read()
            way, asked, over, late = 0.0, list[tuple[NDArray[Any], Array]](), False, False
            while not (over or late):
                wanted = 2.0 * wave.activation((len(asked) + 1) * INTERVAL_S[self._body], n) - 1.0
                action = np.clip(wanted + rng.normal(0.0, WAVE_NOISE, n), -INSIDE, INSIDE)
                after, reward, over, late, _ = env.step(action)
                asked.append((before, wanted))
                info = [{"TimeLimit.truncated": late}]
                self._model.replay_buffer.add(before, after, action, np.array([reward]), np.array([over or late]), info)
                before, way = after, way + reward
            shown.append((way, asked))
        best = sorted(shown, key=lambda one: -one[0])[: WAVES // 3]
        pairs = [pair for _, asked in best for pair in asked]
        reads, wanted = (torch.tensor(np.array(side), dtype=torch.float32) for side in zip(*pairs, strict=True))
        actor = self._model.policy.actor
        optimizer = torch.optim.Adam([*actor.latent_pi.parameters(), *actor.mu.parameters()], lr=0.01)
        for _ in range(IMITATION):
            optimizer.zero_grad()
            asked = torch.tanh(actor.mu(actor.latent_pi(reads)))
            torch.nn.functional.mse_loss(asked, wanted).backward()
            optimizer.step()
        with torch.no_grad():
            actor.log_std.weight.zero_()
            actor.log_std.bias.fill_(LOG_NOISE)
        # Only the critic learns now: what it believes at first would spoil the actor.
        actor.requires_grad_(False)
        self._model.train(CRITIC_FIRST, batch_size=OPTIONS["batch_size"])
        actor.requires_grad_(True)

    def _save(self) -> None:
        """Writes a checkpoint and removes those before it; a folder that is there is whole."""
        before = _checkpoints(self._folder)
        draft, memory = self._folder / "draft", self._model.replay_buffer
        shutil.rmtree(draft, ignore_errors=True)
        draft.mkdir(parents=True)
        parameters = {"parameters": self._model.get_parameters(), "log_ent_coef": self._model.log_ent_coef}
        torch.save(parameters, draft / "parameters.pt")
        rows = memory.buffer_size if memory.full else memory.pos
        np.savez(draft / "memory.npz", **{name: getattr(memory, name)[:rows] for name in ARRAYS})
        write_csv(draft / "curve.csv", Piece.__slots__, map(astuple, self.pieces))
        write_text(draft / "best.json", json.dumps(self.best))
        draft.rename(self._folder / f"{self.pieces[-1].steps:09d}")
        for folder in before:
            shutil.rmtree(folder)

    def _load(self, folder: Path) -> None:
        # Neither runs code that a file holds.
        saved = torch.load(folder / "parameters.pt", weights_only=True)
        self._model.set_parameters(saved["parameters"])
        self._model.log_ent_coef.data.copy_(saved["log_ent_coef"].data)
        memory = self._model.replay_buffer
        with np.load(folder / "memory.npz", allow_pickle=False) as arrays:
            for name in ARRAYS:
                getattr(memory, name)[: len(arrays[name])] = arrays[name]
            memory.pos, memory.full = len(arrays["dones"]), False
        with (folder / "curve.csv").open(newline="", encoding="utf-8") as file:
            self.pieces = [Piece(row[0], int(row[1]), *map(float, row[2:])) for row in list(csv.reader(file))[1:]]
        self.best = json.loads((folder / "best.json").read_text(encoding="utf-8"))
        self._model.num_timesteps = self.pieces[-1].steps


def _checkpoints(folder: Path) -> list[Path]:
    return sorted(folder.glob("[0-9]*"))


def _rounded(weights: Any) -> list[Any]:
    def short(value: Any) -> Any:
        return [short(each) for each in value] if isinstance(value, list) else float(f"{value:.{DIGITS}g}")

    return short(weights.detach().numpy().tolist())


def train(bodies: Sequence[str], n_steps: int, folder: Path, progress: StudyProgress | None = None) -> list[Path]:
    """Trains a policy for each body, and writes it as an entrant.

    Args:
        bodies: Names of the bodies; none for all.
        n_steps: Steps of the environment, beside the waves at the beginning.
        folder: Where checkpoints are kept, and where to write ``policy.toml``, the file of entrants, and the learning
            curves, ``policy.csv`` with a picture. Called again, it goes on from the checkpoints.
        progress: Told how far it is.

    Raises:
        ConfigError: A body is unknown.
    """
    found, on, pieces = all_tasks(), dict[str, Any](), list[Piece]()
    for body in bodies:
        if body not in found.bodies:
            raise ConfigError(f"unknown body {body!r}: {suggest(body, found.bodies)}")
    for body in bodies or found.bodies:
        learner = Learner(body, folder / "training" / body)
        for piece in learner.learn(n_steps):
            if progress is not None:
                progress(f"training {body}", piece.steps, n_steps, piece.steps / n_steps)
        on[body] = {f"controller.{field}": value for field, value in learner.best.items()}
        pieces += learner.pieces
    entrant = Entrant(
        summary="a network that imitated waves and was trained on by reinforcement learning",
        controller={"kind": "policy"},
        on=on,
        tuned_on=tuple(range(FIRST_TEST_SEED)),
    )
    return [
        write_entrants({"policy": entrant}, folder / "policy.toml"),
        write_csv(folder / "policy.csv", Piece.__slots__, map(astuple, pieces)),
        _curves(grouped(pieces, lambda one: one.body), folder / "policy"),
    ]


def _curves(pieces: Mapping[str, Sequence[Piece]], stem: Path) -> Path:
    with canvas(2.6) as figure:
        for axes, (body, own) in zip(figure.subplots(1, len(pieces), squeeze=False)[0], pieces.items(), strict=True):
            steps = [one.steps for one in own]
            axes.plot(steps, [100 * one.training_m_per_s for one in own], ".-", color="0.6", label="while it learns")
            for task, color in zip(TASKS, segment_colors(len(TASKS)), strict=True):
                speeds = [100 * getattr(one, f"{task}_m_per_s") for one in own]
                axes.plot(steps, speeds, "o-", color=color, markersize=3, label=task)
            axes.set(xlabel="steps of the environment", ylabel="speed (cm/s)")
            panel_title(axes, body)
        figure.axes[0].legend()
        return save_both(figure, stem)
