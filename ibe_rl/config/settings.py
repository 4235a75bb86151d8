"""The settings that all kinds share: name, type, default, limits and meaning. Files in configs/ pick and override.

A kind of agent, instructor, mapping or predictor adds its own in its module (``ibe_rl.config.kinds``). A field's
metadata holds its limits; ``ibe_rl.config.limits.check`` refuses what is outside before anything is built.
See all values of a run with ``python train.py --cfg job``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ibe_rl.config.limits import KEPT, MISSING, TINY, setting

MAX_SEED = 9_999
DEGREES = {"slightly": 0.15, "moderately": 0.4, "": 0.75}


@dataclass
class PhrasesConfig:
    """The words for one number of the instruction; see ``ibe_rl.task.Phrases``."""

    zero: str = MISSING
    negative: str = MISSING  # with {degree} where the word for it goes
    positive: str = MISSING
    degrees: dict[str, float] = field(default_factory=lambda: dict(DEGREES))  # word: from which magnitude on, rising


@dataclass
class TaskConfig:
    """See ``ibe_rl.task.Task``. What is ``module:name`` is a function, or a class that is made without arguments.

    Modules are looked for where Python does and in the folder that the program was started in.
    """

    name: str = MISSING
    rule: str = MISSING  # module:name; states (..., S) to instructions (..., d)
    phrases: list[PhrasesConfig] = MISSING  # one for each number of the instruction
    explained: list[str] = MISSING  # the state dimensions that its numbers speak of: each rises where the rule says +1
    explained_band: list[float] = MISSING  # change of each beyond which it went one way or the other
    explained_range: list[float] = field(default_factory=list)  # how far each reaches; empty: 1 each
    instruction_values: list[float] = field(default_factory=lambda: [-1.0, 0.0, 1.0])  # that each number can have
    state_names: list[str] = field(default_factory=list)  # empty: state_0, state_1, ...
    state_units: list[str] = field(default_factory=list)  # empty: none
    max_episode_steps: int | None = setting(None, low=1)  # None: as it is registered
    success: str | None = None  # module:name; last state (S,), terminated, truncated to bool
    success_key: str | None = None  # or the key of its info that says so; with neither nothing counts as success
    context: str | None = None  # module:name; first state (S,) to the name of what the episode is about
    contexts: list[str] = field(default_factory=list)  # all such names
    context_option: str | None = None  # the key of the reset option that fixes it
    motion: str | None = None  # module:name; states (..., S) to the change (..., d) in one step as it moves now
    goal_offset: str | None = None  # module:name; states (..., S) to how far (..., d) the goal lies above
    first_contact: str | None = None  # module:name; states (T + 1, S) to the step at which the outcome is seen
    hidden_goal: dict[str, Any] = field(default_factory=dict)  # arguments with which nobody can see the goal
    scene_path: str | None = None  # module:name; states (..., S) to points (..., 2) of a drawing, y up
    scene_size: list[float] = field(default_factory=lambda: [1.0, 1.0])  # width and height of the drawing
    background: str | None = None  # module:name; the environment to the list of ibe_rl.task.Shape that stand still
    figure: str | None = None  # module:name; the environment to those that move


CODE_SETTINGS = (
    *("rule", "success", "context", "motion", "goal_offset", "first_contact"),
    *("scene_path", "background", "figure"),
)
"""The settings that name code."""


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
    processes: int = setting(2, low=1, high=64, kept=True)  # 1 collects in the training process itself, but over Ray
    envs_per_process: int = setting(64, low=1, high=1024, kept=True)
    steps_per_batch: int = setting(64, low=1, high=100_000, kept=True)  # of each environment
    overlap: bool = setting(
        False, kept=True
    )  # collect a batch, in processes of its own, while learning from the one before
    ahead_batches: int = setting(1, low=1, high=16, kept=True)  # with overlap: so many may be under way
    timeout_s: float | None = setting(300.0, low=1.0)  # a worker without a batch for so long hangs: the run ends


@dataclass
class LogConfig:
    """The log of whole episodes."""

    capacity_frames: int = setting(1_000_000, low=10_000)  # the oldest episodes make room; about 60 bytes a frame


@dataclass
class AgentConfig:
    """What all agents share."""

    kind: str = field(default=MISSING, metadata=KEPT)
    hidden: list[int] = field(default_factory=lambda: [64, 64], metadata=KEPT)
    ignores: list[str] = field(default_factory=list, metadata=KEPT)  # names of state dimensions that it does not see
    gamma: float = setting(0.995, low=0.0, high=1.0)
    learning_rate: float = setting(1e-3, low=0.0, high=1.0)
    success_bonus: float = setting(100.0, low=0.0)  # added where the environment says success, for the learner only
    reward_scale: float = setting(0.05, low=TINY)  # both are multiplied with it
    average_share: float = setting(0.1, low=0.0, high=1.0)  # of the updates so far: what is explained averages them


@dataclass
class InstructorConfig:
    """What all instructors share."""

    kind: str = "oracle"


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
class PredictorConfig:
    """What all predictors share; as it stands the simulator, the environment's own engine from a snapshot."""

    kind: str = setting("simulator", kept=True)
    future_instruction: str = setting("hold", choices=("hold", "rule"), learnt=False)
    processes: int | None = setting(
        None, low=1, high=64, learnt=False
    )  # that share the moments; None: 1, to judge a run 2
    futures: int = setting(
        3, low=1, high=100, learnt=False
    )  # sampled from each moment; what most of them are called is said
    moments_at_once: int = setting(
        32, low=1, learnt=False
    )  # copies of the environment; more of them crowd the processor's cache


@dataclass
class ViewerConfig:
    """``live`` records and serves the recording, ``file`` records only, ``off`` does neither."""

    mode: str = setting("live", choices=("live", "file", "off"))
    grpc_port: int | None = setting(None, low=1, high=65535)  # None: 9876, or a free one
    web_port: int | None = setting(None, low=1, high=65535)  # None: 9090, or a free one
    max_recording_mb: int = setting(50, low=1)  # of 10^6 bytes; a long training is recorded more and more sparsely


@dataclass
class ListenerConfig:
    """What all listeners share."""

    kind: str = MISSING  # module:Class


@dataclass
class MetricConfig:
    """What all metrics share."""

    kind: str = MISSING  # module:Class


@dataclass
class TrainConfig:
    """``train.py``.

    With ``refresh_every_frames=0`` the vocabulary is learnt anew eight times in a run, in a long one every 250,000
    frames. With ``refresh_when_stale`` it is not replaced by the clock: a new one is learnt each time, and replaces the
    standing one if it puts the newest episodes into words better by more than this (``motion_auc``).
    """

    seed: int = setting(0, low=0, high=MAX_SEED, kept=True)
    total_frames: int = setting(2_000_000, low=1)  # rounded up to whole batches
    stop_after_frames: int | None = setting(None, low=1)  # end in order there, in the middle of all schedules
    run_dir: str = field(default=MISSING, metadata=KEPT)
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
    env: EnvConfig = field(default=MISSING, metadata=KEPT)
    collect: CollectConfig = field(default_factory=CollectConfig)
    log: LogConfig = field(default_factory=LogConfig, metadata=KEPT)
    agent: AgentConfig = MISSING
    instructor: InstructorConfig = field(default=MISSING, metadata=KEPT)
    obedience: ObedienceConfig = field(default_factory=ObedienceConfig)
    mapping: MappingConfig = field(default=MISSING, metadata=KEPT)
    predictor: PredictorConfig = MISSING
    viewer: ViewerConfig = MISSING
    listeners: dict[str, ListenerConfig] = field(default_factory=dict)  # by name; chosen as listener=[NAME,...]
    metrics: dict[str, MetricConfig] = field(default_factory=dict)  # by name; chosen as metric=[NAME,...]


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
