"""How much is run: the sizes of a real run, and tiny ones that only show that everything works."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parent.parent
LEVELS = {"83": 0.83}
"""Shares of evaluation episodes that succeed, by their name in the figures; there a run of Stable-Baselines3 ends."""
REWARDED = "obedience.judge=mapping"
"""The setting that rewards following the instruction, as the learnt vocabulary understands it."""


@dataclass(frozen=True)
class Sizes:
    """What each part runs.

    Attributes:
        overrides: of every run of train.py.
        skill_steps: steps of the environment with which Stable-Baselines3 runs to skill, by algorithm.
        skill_overrides: of the runs of train.py to skill, by algorithm; a Q-network does not get there by default.
        rewarded: algorithms that run to skill with reward for following the instruction, too.
        evaluate_every: frames between two evaluations on the way to skill, by algorithm.
        evaluation_episodes: of each of them.
        fresh_episodes: that the training has not seen, on which the end of a run of train.py to skill is judged.
        cap_frames: where a run of Stable-Baselines3 ends that has not reached the levels, by algorithm.
        rollout_steps: of each environment, in Stable-Baselines3's PPO.
        vec_env_steps: the same where its two vector environments are compared.
        short_frames: of the shortened runs of train.py.
        fault_frames: of the runs with a fault in the middle.
        sweep_frames: of each of the two runs that are made side by side.
        default_frames: of the runs that show how the time of the default run is spent; None: its own.
        learn_frames: of Stable-Baselines3's learn() where frames a second are counted.
        collect: settings of our collector that differ from the default.
        collect_batches: batches of our collector that are timed.
        bare_seconds: how long gymnasium's own game is stepped.
        moments: explained together.
        live_moments: explained one at a time.
        flown_frames: real frames that the logs are filled with.
        logs: frames seen and capacity of each log, by the name in the figures.
    """

    overrides: tuple[str, ...] = ()
    skill_steps: Mapping[str, tuple[str, ...]] = field(
        default_factory=lambda: {"ppo": ("lean", "gymnasium"), "dqn": ("lean",)}
    )
    skill_overrides: Mapping[str, tuple[str, ...]] = field(
        default_factory=lambda: {"ppo": (), "dqn": ("total_frames=2_000_000",)}
    )
    rewarded: tuple[str, ...] = ("ppo",)
    evaluate_every: Mapping[str, int] = field(default_factory=lambda: {"ppo": 50_000, "dqn": 20_000})
    evaluation_episodes: int = 100
    fresh_episodes: int = 500
    cap_frames: Mapping[str, int] = field(default_factory=lambda: {"ppo": 3_000_000, "dqn": 400_000})
    rollout_steps: int = 1024
    vec_env_steps: int = 256
    short_frames: int = 400_000
    fault_frames: int = 500_000
    sweep_frames: int = 500_000
    default_frames: int | None = None
    learn_frames: int = 49_152
    collect: Mapping[str, int] = field(default_factory=dict)
    collect_batches: int = 10
    bare_seconds: float = 5.0
    moments: int = 300
    live_moments: int = 100
    flown_frames: int = 20_000
    logs: Mapping[str, tuple[int, int]] = field(
        default_factory=lambda: {
            "10k": (10_000, 1_000_000),
            "100k": (100_000, 1_000_000),
            "1m": (1_000_000, 1_000_000),
            "3m_seen": (3_000_000, 1_000_000),
        }
    )


SHORT = Sizes(skill_steps={"ppo": ("lean",), "dqn": ("lean",)}, rewarded=())

TINY_COLLECTION = {"processes": 2, "envs_per_process": 4, "steps_per_batch": 64}
QUICK = Sizes(
    overrides=(
        *(f"collect.{name}={value}" for name, value in TINY_COLLECTION.items()),
        *("total_frames=3000", "refresh_every_frames=1500", "mapping.horizon_steps=20", "agent.hidden=[16]"),
        *("log.capacity_frames=10000", "eval_every_frames=3000", "eval_episodes=4"),
    ),
    evaluate_every={"ppo": 1000, "dqn": 1000},
    evaluation_episodes=4,
    fresh_episodes=6,
    cap_frames={"ppo": 3000, "dqn": 2000},
    rollout_steps=64,
    vec_env_steps=32,
    short_frames=3000,
    fault_frames=20_000,
    sweep_frames=3000,
    default_frames=4000,
    learn_frames=2048,
    collect=TINY_COLLECTION,
    collect_batches=3,
    bare_seconds=0.5,
    moments=20,
    live_moments=5,
    flown_frames=2000,
    logs={"10k": (2000, 20_000), "100k": (5000, 20_000), "1m": (20_000, 20_000), "3m_seen": (60_000, 20_000)},
)


@dataclass(frozen=True)
class Form:
    """What is run unless the command line says otherwise.

    Attributes:
        sizes: how much is run.
        parts: of the benchmarks; empty: all.
        seeds: of the runs to skill.
        repeats: of everything else.
        cap_seconds: where a run of Stable-Baselines3 ends that has not reached the levels.
        output: a folder for all that is written; None: the repository's places.
    """

    sizes: Sizes
    parts: tuple[str, ...] = ()
    seeds: tuple[int, ...] = (0, 1, 2, 3, 4)
    repeats: int = 3
    cap_seconds: float = 900.0
    output: Path | None = None


FORMS = {
    "full": Form(Sizes()),
    "short": Form(
        SHORT,
        parts=("skill-ppo", "frames", "explanations", "setup"),
        seeds=(0,),
        repeats=1,
        cap_seconds=120.0,
        output=Path("runs/benchmarks-short"),
    ),
    "quick": Form(QUICK, seeds=(0, 1), output=Path("runs/benchmarks-quick")),
}


@dataclass(frozen=True)
class Plan:
    """How much is run, and where it is written.

    Attributes:
        seeds: of the runs to skill.
        repeats: of everything else.
        cap_seconds: where a run of Stable-Baselines3 ends that has not reached the levels.
        sizes: how much is run.
        resume: whether seeds that were run before in the same way are taken from ``curves``.
        results: the file of all records.
        curves: the file of the learning curves.
        document: written anew from both.
        picture: of the learning curves.
    """

    seeds: tuple[int, ...]
    repeats: int
    cap_seconds: float
    sizes: Sizes
    resume: bool
    results: Path
    curves: Path
    document: Path
    picture: Path


def make_plan(form: Form, resume: bool = False) -> Plan:
    """Say where what is run goes: into the repository's places, or all into the form's folder."""
    folder = form.output
    data, pages = (folder, folder) if folder else (ROOT / "benchmarks", ROOT / "docs")
    return Plan(
        *(form.seeds, form.repeats, form.cap_seconds, form.sizes, resume),
        results=data / "results.json",
        curves=data / "curves.json",
        document=pages / "BENCHMARKS.md",
        picture=(pages if folder else pages / "img") / "time_to_skill.png",
    )
