"""Every setting: its name, type, default, limits and meaning. The files in configs/ only pick and override.

A field's metadata holds its limits. ``ibe_rl.config.limits.check`` refuses what is outside before anything is built.
See all values of a run with ``python train.py --cfg job``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from omegaconf import MISSING

from ibe_rl.config.limits import TINY, setting
from ibe_rl.config.predictor import PREDICTORS as PREDICTORS
from ibe_rl.config.predictor import EnsembleConfig as EnsembleConfig
from ibe_rl.config.predictor import PredictorConfig as PredictorConfig
from ibe_rl.config.predictor import RegressionConfig as RegressionConfig
from ibe_rl.config.task import TaskConfig

MAX_SEED = 9_999
OTHERS = ("oracle", "silent", "habits")
"""Who can instruct beside a person; ``habits`` does as the person would, going by what they said so far."""


@dataclass
class EnvConfig:
    """A gymnasium environment; what is explained of it is declared by itself (``ibe_rl.task.Task``) or in ``task``."""

    id: str = MISSING  # module:id for one that a module registers
    kwargs: dict[str, Any] = field(default_factory=dict)  # passed to the environment's constructor
    task: TaskConfig | None = None


@dataclass
class CollectConfig:
    """How experience is gathered."""

    engine: str = setting("processes", choices=("processes", "ray"))  # ray: on this machine or on a cluster
    address: str | None = None  # of the Ray cluster, as host:port; None: Ray on this machine, for this run
    processes: int = setting(2, low=1, high=64)  # 1 collects in the training process itself, but over Ray
    envs_per_process: int = setting(64, low=1, high=1024)
    steps_per_batch: int = setting(64, low=1, high=100_000)  # of each environment
    overlap: bool = False  # collect a batch, in processes of its own, while learning from the one before
    ahead_batches: int = setting(1, low=1, high=16)  # with overlap: so many may be under way
    timeout_s: float | None = setting(300.0, low=1.0)  # a worker without a batch for so long hangs: the run ends


@dataclass
class LogConfig:
    """The log of whole episodes."""

    capacity_frames: int = setting(1_000_000, low=10_000)  # the oldest episodes make room; about 60 bytes a frame


@dataclass
class AgentConfig:
    """What all agents share."""

    kind: str = MISSING
    hidden: list[int] = field(default_factory=lambda: [64, 64])
    ignores: list[str] = field(default_factory=list)  # names of state dimensions that it does not see
    gamma: float = setting(0.995, low=0.0, high=1.0)
    learning_rate: float = setting(1e-3, low=0.0, high=1.0)
    success_bonus: float = setting(100.0, low=0.0)  # added where the environment says success, for the learner only
    reward_scale: float = setting(0.05, low=TINY)  # both are multiplied with it
    average_share: float = setting(0.1, low=0.0, high=1.0)  # of the updates so far: what is explained averages them


@dataclass
class PPOConfig(AgentConfig):
    """Proximal policy optimisation; learning rate and entropy bonus fall linearly to 0 over the run."""

    kind: str = setting("ppo", choices=("ppo",))
    gae_lambda: float = setting(0.98, low=0.0, high=1.0)
    clip: float = setting(0.2, low=1e-6, high=1.0)
    epochs: int = setting(4, low=1)
    minibatch_size: int = setting(512, low=2)
    entropy: float = setting(0.004, low=0.0)
    first_std: float = setting(0.6, low=TINY, high=10.0)  # of continuous actions at the start, in half ranges
    value_weight: float = setting(0.5, low=0.0)
    max_grad_norm: float = setting(0.5, low=TINY)


@dataclass
class DQNConfig(AgentConfig):
    """Deep Q-learning with a slowly following target network, the paper's kind of agent.

    The learning rate falls linearly to 0 over the run; epsilon from 1 to ``epsilon_early`` and on to ``epsilon_end``.
    """

    kind: str = setting("dqn", choices=("dqn",))
    n_steps: int = setting(5, low=1, high=1_000)  # of real rewards before the target network is asked
    buffer_frames: int = setting(400_000, low=1_000)
    minibatch_size: int = setting(256, low=1)
    frames_per_update: int = setting(10, low=1)
    learn_after_frames: int = setting(5_000, low=0)
    epsilon_early: float = setting(0.1, low=0.0, high=1.0)
    epsilon_end: float = setting(0.0, low=0.0, high=1.0)
    epsilon_share: float = setting(0.05, low=0.0, high=1.0)  # of the run, until epsilon_early
    target_rate: float = setting(1.0, low=TINY, high=1.0)  # share of the way to the network, a batch; 1: all of it


@dataclass
class ExternalPolicyConfig(AgentConfig):
    """An agent that was trained elsewhere; a run folder says what it was, and never where to load it from."""

    kind: str = setting("guest", choices=("guest",))
    sees_instruction: bool | None = None  # None: it says so itself
    made_from: str = "an object in Python"  # for messages


@dataclass
class InstructorConfig:
    """Who instructs: ``oracle`` follows the environment's rule at every step, ``silent`` never says anything."""

    kind: str = setting("oracle", choices=("oracle", "silent"))


@dataclass
class FlawedConfig(InstructorConfig):
    """The oracle with the flaws of a person; whether it is wrong or away is drawn anew for each spell of time."""

    kind: str = setting("flawed", choices=("flawed",))
    wrong: float = setting(0.0, low=0.0, high=1.0)  # share of the time in which it says another value
    late_steps: int = setting(0, low=0, high=1_000)  # it says what was right so many steps ago; until then nothing
    present: float = setting(1.0, low=0.0, high=1.0)  # share of the time in which it says anything
    spell_steps: int = setting(25, low=1)  # 1: drawn at every step


@dataclass
class RecordedConfig(InstructorConfig):
    """A person's session once more, in the first environment; see ``HumanConfig``."""

    kind: str = setting("recorded", choices=("recorded",))
    recording: str = MISSING  # the folder of the run in which the person taught
    others: str = setting("oracle", choices=OTHERS)  # who instructs the other environments


@dataclass
class HumanConfig(InstructorConfig):
    """A person, in a browser, instructs the first environment; all of them step at the pace of its clock."""

    kind: str = setting("human", choices=("human",))
    others: str = setting("oracle", choices=OTHERS)  # who instructs the other environments
    hold_steps: int | None = setting(0, low=0)  # what was said last holds on for so long; None: until the episode ends
    speed: float | None = setting(1.0, low=0.05, high=1_000.0)  # at the start, in times of real time; None: unthrottled
    host: str = "127.0.0.1"  # that the page is served on; whoever can reach it can instruct
    port: int | None = setting(None, low=1, high=65535)  # None: 8765, or a free one


INSTRUCTORS = {"flawed": FlawedConfig, "recorded": RecordedConfig, "human": HumanConfig}
"""The kinds of instructor with settings of their own."""


@dataclass
class ObedienceConfig:
    """Extra reward for having done what one was told, which fades out (see ``ibe_rl.training.instruction_reward``)."""

    judge: str = setting("none", choices=("none", "mapping", "oracle"))  # what the agent has learnt, or what is meant
    weight: float = setting(0.1, low=0.0)  # of a step at the start, in units of the environment's reward
    until_frames: int = setting(500_000, low=1)  # from there on it is 0


@dataclass
class MappingConfig:
    """How the vocabulary is learnt; as it stands here, the paper's (docs/PAPER.md, docs/QUALITY.md say why)."""

    kind: str = "paper"  # what the mapping is called in summaries and tables
    horizon_steps: int | None = setting(None, low=1)  # None: found in the episodes at each refresh
    spans_steps: list[int] = field(default_factory=lambda: [20])  # other horizons; where n was found only shorter ones
    top_fraction: float = setting(0.25, low=TINY, high=1.0)
    top_within: str = setting("all", choices=("all", "context"))
    window_end: str = setting("clamp", choices=("drop", "clamp"))
    failed_ends: str = setting("keep", choices=("keep", "drop"))  # windows that reach the end of an episode gone wrong
    n_clusters: int = setting(8, low=2)  # for each number of an instruction: two of them get twice as many together
    space: str = setting("all", choices=("all", "information", "lasso", "network", "rule"))  # see ibe_rl.ibe.IBEMapping
    split: str = setting("kmeans", choices=("kmeans", "bisecting", "quantile"))
    power: float = setting(1.0, low=0.05, high=1.0)  # of a movement's magnitude: below 1 small ones get more clusters
    symmetric: bool = False  # as many clusters on both sides
    normalisation: str = setting("minmax", choices=("minmax", "sign", "movement"))
    membership: str = setting("hard", choices=("hard", "soft", "direct"))
    meaning: str = setting("tested", choices=("tested", "assumed"))  # assumed: words mean what the best did, untested
    weigh_followed: bool = False  # windows count by how well the instruction was followed
    dimensions: list[str] = field(default_factory=list)  # names of state dimensions that count; empty: all
    hidden: list[int] = field(default_factory=lambda: [32, 32])  # of space=network
    n_init: int = setting(4, low=1)  # k-means starts of a refresh that starts from nothing
    newest_frames: int | None = setting(250_000, low=1)  # episodes that ended in these count; None: the whole log
    memory: float | None = setting(0.85, low=0.0, high=0.99)  # what earlier windows still count; None: from nothing
    survival_overlap: float = setting(0.5, low=TINY, high=1.0)  # with less in common a cluster is not the same one
    hold_within: float = setting(0.15, low=0.0, high=2.0)  # a surviving cluster's expression moves by more or stays
    max_fit_windows: int = setting(20_000, low=100)  # clusters are learnt from at most so many, drawn at random


@dataclass
class ViewerConfig:
    """``live`` records and serves the recording, ``file`` records only, ``off`` does neither."""

    mode: str = setting("live", choices=("live", "file", "off"))
    grpc_port: int | None = setting(None, low=1, high=65535)  # None: 9876, or a free one
    web_port: int | None = setting(None, low=1, high=65535)  # None: 9090, or a free one
    max_recording_mb: int = setting(50, low=1)  # of 10^6 bytes; a long training is recorded more and more sparsely


@dataclass
class TrainConfig:
    """``train.py``.

    With ``refresh_every_frames=0`` the vocabulary is learnt anew eight times in a run, in a long one every 250,000
    frames. With ``refresh_when_stale`` it is not replaced by the clock: a new one is learnt each time, and replaces the
    standing one if it puts the newest episodes into words better by more than this (``motion_auc``).
    """

    seed: int = setting(0, low=0, high=MAX_SEED)
    total_frames: int = setting(2_000_000, low=1)  # rounded up to whole batches
    stop_after_frames: int | None = setting(None, low=1)  # end in order there, in the middle of all schedules
    run_dir: str = MISSING
    runs_at_once: int | None = setting(None, low=1, high=1024)  # of a sweep (-m); None: a core for each process
    runs_on: str | None = None  # of a sweep: HOST:PORT of a Ray cluster that this machine is part of; None: here
    resume: str | None = None  # the folder of a run that goes on; other settings than its own are named beside it
    resume_from: str = setting("latest", choices=("latest", "best"))  # its latest state, or that of its best evaluation
    checkpoint_every_frames: int = setting(100_000, low=1)  # and at refreshes, evaluations: the state to resume from
    refresh_every_frames: int | None = setting(0, low=0)  # and at the end; 0: see above; None: no vocabulary at all
    refresh_when_stale: float | None = setting(None, low=-1.0, high=1.0)  # then only if a new one tells more, see below
    min_confidence: float = setting(0.5, low=0.0, high=1.0)  # under it the agent says that it does not know
    explain_every_steps: int = setting(5, low=1)  # of the episode watched at a refresh; in between the last one holds
    eval_every_frames: int = setting(400_000, low=1)  # and at the end
    eval_episodes: int = setting(100, low=1, high=10_000)
    keep_policy_every_frames: int | None = setting(10_000, low=1)  # for agents of any skill, rarer later; None: never
    report: bool = False  # in the end do the paper's experiments with it, as explain.py task=figures
    env: EnvConfig = MISSING
    collect: CollectConfig = field(default_factory=CollectConfig)
    log: LogConfig = field(default_factory=LogConfig)
    agent: AgentConfig = MISSING
    instructor: InstructorConfig = MISSING
    obedience: ObedienceConfig = field(default_factory=ObedienceConfig)
    mapping: MappingConfig = MISSING
    predictor: PredictorConfig = MISSING
    viewer: ViewerConfig = MISSING


@dataclass
class EvaluateConfig:
    """How it is judged whether what the agent says is true (``task=evaluate`` and ``task=compare``)."""

    seed: int = setting(0, low=0, high=999)  # another one flies other episodes and draws other futures
    episodes: int = setting(100, low=2, high=10_000)
    calibration_episodes: int = setting(60, low=2, high=10_000)  # others, that the confidence is calibrated on
    changing_episodes: int = setting(40, low=0, high=10_000)  # with each policy that was kept; 0 leaves that out
    stride_steps: int = setting(4, low=1)  # from one moment that is judged to the next
    horizons_steps: list[int] = field(default_factory=lambda: [20, 40, 60, 100])  # and the run's own
    resamples: int = setting(1_000, low=20, high=100_000)  # of the episodes, for the intervals
    shuffles: int = setting(50, low=1, high=10_000)  # vocabularies from shuffled instructions, and from random clusters


@dataclass
class CompareConfig:
    """Which mappings ``task=compare`` holds against each other."""

    mappings: list[str] = field(default_factory=list)  # names of files in configs/mapping; empty: all


@dataclass
class FiguresConfig:
    """The paper's experiments, done again with the agents of a run (``task=figures``)."""

    seed: int = setting(0, low=0, high=999)  # another one flies other episodes and draws other futures
    episodes: int = setting(200, low=10, high=10_000)  # flown again by each of the agents A, B and C
    checked_episodes: int = setting(100, low=2, high=10_000)  # others, that no vocabulary is learnt from
    prediction_episodes: int = setting(20, low=2, high=1_000)  # that observers foretell the end of
    clusterings: int = setting(8, low=1, high=1_000)  # of each vocabulary; rates of words are means over them
    shuffles: int = setting(20, low=1, high=1_000)  # vocabularies from shuffled instructions
    resamples: int = setting(1_000, low=20, high=100_000)  # of the episodes, for the intervals


@dataclass
class ExplainConfig:
    """``explain.py``."""

    run: str | None = None  # None: the newest below runs/
    agent_file: str | None = None  # agent=FILE.zip or MODULE:NAME on the command line: trained elsewhere
    agent_sees_instruction: bool | None = None  # None: it says so itself, or did when its run folder was made
    episodes: int = setting(200, low=2, high=100_000)  # of such an agent, that its vocabulary is learnt from
    random_actions: float = setting(0.0, low=0.0, high=1.0)  # share of the actions in them
    run_dir: str = MISSING  # of the folder that is made for it
    guest_settings: list[str] = field(default_factory=list)  # env=, env.…, mapping=, mapping.…: as of a training
    sweep_dir: str | None = None  # sweep=DIR on the command line: a report of all runs of that sweep instead
    task: str = setting("episode", choices=("episode", "evaluate", "compare", "predictors", "figures"))
    seed: int = setting(0, low=0, high=2**31 - 1)  # of the episode
    context: str | None = None  # what the episode is about; None draws one
    min_confidence: float = setting(0.5, low=0.0, high=1.0)  # under it the agent says that it does not know
    predictor: PredictorConfig = MISSING
    viewer: ViewerConfig = MISSING
    evaluate: EvaluateConfig = field(default_factory=EvaluateConfig)
    compare: CompareConfig = field(default_factory=CompareConfig)
    figures: FiguresConfig = field(default_factory=FiguresConfig)
    output: str | None = None  # where the recording goes; None: into the run's folder
