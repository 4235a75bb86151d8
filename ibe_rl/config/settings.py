"""The settings that all kinds share: name, type, default, limits and meaning. Files in configs/ pick and override.

A kind of agent, instructor, mapping or predictor adds its own in its module (``ibe_rl.config.kinds``).
Limits are field metadata, checked before anything is built. All values of a run: ``python train.py --cfg job``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ibe_rl.config.limits import KEPT, MISSING, TINY, setting
from ibe_rl.config.own_words import OwnWords
from ibe_rl.config.report_settings import CompareConfig, FiguresConfig, SummaryConfig
from ibe_rl.config.task_parts import MirrorConfig, PhrasesConfig

MAX_SEED = 9_999
EXPLAIN_TASKS = ("episode", "evaluate", "compare", "predictors", "figures", "summary")


@dataclass
class TaskConfig:
    """See ``ibe_rl.task.Task``. ``module:name``: a function or a class without arguments, found from where you are."""

    name: str = MISSING  # shown in titles
    state: str | None = None  # module:name; (environment, its observation) to the state (S,); None: the observation
    observes: list[str] = field(default_factory=list)  # keys of a Dict observation that the agent reads; empty: all
    rule: str = MISSING  # module:name; states (..., S) to instructions (..., d)
    phrases: list[PhrasesConfig] = MISSING  # one per number of the instruction
    explained: list[str] = MISSING  # one state dimension per number of the instruction; +1 means it should rise
    explained_band: list[float] = MISSING  # smallest change of each that counts as movement
    explained_range: list[float] = field(default_factory=list)  # range of each, the unit of errors; empty: 1 each
    instruction_values: list[float] = field(default_factory=lambda: [-1.0, 0.0, 1.0])  # values of each number
    state_names: list[str] = field(default_factory=list)  # empty: state_0, state_1, ...
    state_units: list[str] = field(default_factory=list)  # empty: none
    max_episode_steps: int | None = setting(None, low=1)  # None: as registered with gymnasium
    success: str | None = None  # module:name; (last state (S,), terminated, truncated) to bool
    success_key: str | None = None  # or a key of info; with neither, no episode counts as a success
    context: str | None = None  # module:name; first state (S,) to the name of the episode's context
    contexts: list[str] = field(default_factory=list)  # all context names
    context_option: str | None = None  # key of the reset option that sets the context
    motion: str | None = None  # module:name; states (..., S) to the change (..., d) in one step at current velocity
    goal_offset: str | None = None  # module:name; states (..., S) to goal minus explained dimensions (..., d)
    first_contact: str | None = None  # module:name; states (T + 1, S) to the step when the outcome is visible
    hidden_goal: dict[str, Any] = field(default_factory=dict)  # constructor arguments that hide the goal
    scene_path: str | None = None  # module:name; states (..., S) to drawing points (..., 2), y up
    scene_size: list[float] = field(default_factory=lambda: [1.0, 1.0])  # width and height of the drawing
    mirror: MirrorConfig | None = None  # the mirror image, where it is the same environment
    background: str | None = None  # module:name; environment to its static shapes, list of ibe_rl.task.Shape
    figure: str | None = None  # module:name; environment to its moving shapes


CODE_SETTINGS = (
    *("state", "rule", "success", "context", "motion", "goal_offset", "first_contact"),
    *("scene_path", "background", "figure"),
)
"""The settings that name code."""


@dataclass
class EnvConfig(OwnWords):
    """A gymnasium environment; its task is its own attribute (``ibe_rl.task.Task``) or declared in ``task``."""

    id: str = MISSING  # gymnasium id, or module:id to import the module first
    kwargs: dict[str, Any] = field(default_factory=dict)  # passed to the environment's constructor
    task: TaskConfig | None = None
    given: bool = False  # true in the folder of a run whose environment a Python program gave (ibe_rl.settings)


@dataclass
class CollectConfig:
    """How experience is gathered."""

    engine: str = setting("processes", choices=("processes", "ray"))  # ray: one machine or a cluster
    address: str | None = None  # host:port of a Ray cluster; None: start Ray on this machine for this run
    processes: int = setting(2, low=1, high=64, kept=True)  # 1: in the training process, except with Ray
    envs_per_process: int = setting(64, low=1, high=1024, kept=True)  # environments that step as one
    steps_per_batch: int = setting(64, low=1, high=100_000, kept=True)  # per environment
    overlap: bool = setting(False, kept=True)  # collect in separate processes while learning
    ahead_batches: int = setting(1, low=1, high=16, kept=True)  # with overlap: batches collected ahead of learning
    timeout_s: float | None = setting(300.0, low=1.0)  # without a batch before a worker counts as hung; None: never


@dataclass
class LogConfig:
    """The log of whole episodes."""

    capacity_frames: int = setting(1_000_000, low=10_000)  # oldest episodes are dropped first; about 60 bytes a frame


@dataclass
class AgentConfig:
    """What all agents share."""

    kind: str = field(default=MISSING, metadata=KEPT)
    hidden: list[int] = field(default_factory=lambda: [64, 64], metadata=KEPT)  # layer widths of its networks
    ignores: list[str] = field(default_factory=list, metadata=KEPT)  # names of state dimensions hidden from it
    gamma: float = setting(0.995, low=0.0, high=1.0)  # discount of a reward one step later
    learning_rate: float = setting(1e-3, low=0.0, high=1.0)  # of the optimiser
    success_bonus: float = setting(100.0, low=0.0)  # added to the learner's reward on success, not to logged rewards
    reward_scale: float = setting(0.05, low=TINY)  # multiplies reward and bonus
    standardise_observations: bool | None = setting(None, kept=True)  # by mean and deviation; None: where far from 1
    standardise_rewards: bool | None = setting(None, kept=True)  # by the returns' deviation; None: where far from 1
    noise_steps: float = setting(1.0, low=1.0, high=1_000.0)  # mean number of steps that exploration noise is held
    mirror: bool | None = setting(None, kept=True)  # equivariant to the environment's mirror image; None: by its rule
    average_share: float = setting(0.1, low=0.0, high=1.0)  # share of past updates in the evaluated weight average


@dataclass
class InstructorConfig(OwnWords):
    """What all instructors share."""

    kind: str = "oracle"


@dataclass
class ObedienceConfig:
    """Extra reward for following the instruction, annealed to 0 (see ``ibe_rl.training.instruction_reward``)."""

    judge: str = setting("none", choices=("none", "mapping", "oracle"))  # mapping: as learnt; oracle: true meaning
    weight: float = setting(0.5, low=0.0)  # initial, per step, in units of the environment's reward
    until_frames: int = setting(500_000, low=1)  # 0 from here on
    absorbing: bool = True  # a terminated episode counts as standing still ever after


@dataclass
class MappingConfig:
    """What all mappings share; the defaults are the paper's (reasons: docs/PAPER.md, docs/QUALITY.md)."""

    kind: str = "paper"  # name in summaries and tables
    horizon_steps: int | None = setting(None, low=1)  # None: estimated from the episodes at each refresh
    spans_steps: list[int] = field(default_factory=lambda: [20])  # further ones; horizon_steps=None: only shorter
    top_fraction: float = setting(0.25, low=TINY, high=1.0)  # share of the best episodes, from which it is learnt
    top_within: str = setting("all", choices=("all", "context"))  # best of all episodes, or of each context
    window_end: str = setting("clamp", choices=("drop", "clamp"))  # windows past the end: drop, or end with it
    failed_ends: str = setting("keep", choices=("keep", "drop"))  # windows that reach the end of a failed episode
    n_clusters: int = setting(8, low=2)  # per number of an instruction; two numbers get twice as many in total
    meaning: str = setting("tested", choices=("tested", "assumed"))  # assumed: as the best episodes moved, untested
    dimensions: list[str] = field(default_factory=list)  # names of state dimensions to cluster; empty: all
    newest_frames: int | None = setting(250_000, low=1)  # fit on episodes that ended in these; None: the whole log
    survival_overlap: float = setting(0.5, low=TINY, high=1.0)  # least overlap with which a cluster keeps its identity
    delay_steps: int | None = setting(None, low=0, high=1_000)  # of instructions; None: estimated at each refresh
    hold_within: float = setting(0.15, low=0.0, high=2.0)  # a surviving expression changes only by more than this


@dataclass
class PredictorConfig:
    """What all predictors share; the default steps a copy of the environment from a snapshot."""

    kind: str = setting("simulator", kept=True)
    future_instruction: str = setting("hold", choices=("hold", "rule"), learnt=False)  # in rollouts: last one, rule
    processes: int | None = setting(None, low=1, high=64, learnt=False)  # None: 1, or 2 in task=evaluate
    futures: int = setting(3, low=1, high=100, learnt=False)  # rollouts per moment; the majority expression is reported
    moments_at_once: int = setting(32, low=1, learnt=False)  # environments per process; more crowd the cache


@dataclass
class ViewerConfig:
    """``live`` records and serves the recording, ``file`` records only, ``off`` does neither."""

    mode: str = setting("live", choices=("live", "file", "off"))  # record and serve, record only, or neither
    open: str = setting("auto", choices=("auto", "always", "never"))  # the browser; auto: from a terminal on a desktop
    grpc_port: int | None = setting(None, low=1, high=65535)  # None: 9876, or a free one
    web_port: int | None = setting(None, low=1, high=65535)  # None: 9090, or a free one
    max_recording_mb: int = setting(50, low=1)  # MB of 10^6 bytes; recorded more sparsely as the run grows


@dataclass
class ListenerConfig:
    """What all listeners share."""

    kind: str = MISSING  # module:Class


@dataclass
class LoggerConfig:
    """What all loggers share."""

    kind: str = MISSING  # module:Class
    pictures: bool = True  # of each refresh
    waiting_events: int = setting(1_000, low=1)  # batches and refreshes that wait for it; later ones are left out
    closing_s: float = setting(30.0, low=0.0, high=3600.0)  # seconds that the end of training waits for it


@dataclass
class MetricConfig:
    """What all metrics share."""

    kind: str = MISSING  # module:Class


@dataclass
class TrainConfig:
    """A training.

    With ``refresh_when_stale`` each refresh only fits a candidate. It replaces the current vocabulary if its
    ``motion_auc`` on the newest episodes is higher by more than this value.
    """

    seed: int = setting(0, low=0, high=MAX_SEED, kept=True)  # of all random numbers
    total_frames: int = setting(600_000, low=1)  # frames to train for, rounded up to whole batches
    stop_after_frames: int | None = setting(None, low=1)  # stop here, with schedules still set for total_frames
    run_dir: str = field(default=MISSING, metadata=KEPT)  # folder of the run, which is made
    runs_at_once: int | None = setting(None, low=1, high=1024)  # in a sweep (-m); None: one core per process
    runs_on: str | None = None  # in a sweep: HOST:PORT of a Ray cluster this machine belongs to; None: here
    resume: str | None = None  # folder of the run to resume; only settings to change are named beside it
    resume_from: str = setting("latest", choices=("latest", "best"))  # latest checkpoint or best evaluation
    checkpoint_every_frames: int = setting(100_000, low=1)  # between saved states; also at refreshes and evaluations
    refresh_every_frames: int | None = setting(0, low=0)  # 0: eight times, in long runs every 250,000; None: never
    first_refresh_episodes: int = setting(100, low=0)  # after so many the first vocabulary comes early; 0: not early
    refresh_when_stale: float | None = setting(None, low=-1.0, high=1.0)  # least gain in motion_auc; None: any
    min_confidence: float = setting(0.5, low=0.0, high=1.0)  # below this the agent says that it does not know
    explain_every_steps: int = setting(5, low=1)  # in the episode shown at a refresh; each one holds until the next
    what_if_every_steps: int | None = setting(20, low=1)  # at these steps also: if told otherwise; None: never
    eval_every_frames: int = setting(200_000, low=1)  # between evaluations; also at the end
    eval_episodes: int = setting(100, low=1, high=10_000)  # of each evaluation
    keep_policy_every_frames: int | None = setting(10_000, low=1)  # for agents of any skill; None: never
    report: bool = False  # end with the paper's experiments, as task=figures of explain
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
    loggers: dict[str, LoggerConfig] = field(default_factory=dict)  # by name; chosen as logger=[NAME,...]
    metrics: dict[str, MetricConfig] = field(default_factory=dict)  # by name; chosen as metric=[NAME,...]


@dataclass
class EvaluateConfig:
    """How explanations are scored (``task=evaluate`` and ``task=compare``)."""

    seed: int = setting(0, low=0, high=999)  # of the episodes and of the sampled futures
    episodes: int = setting(100, low=2, high=10_000)  # on which it is judged
    calibration_episodes: int = setting(60, low=2, high=10_000)  # held-out episodes to calibrate the confidence on
    changing_episodes: int = setting(40, low=0, high=10_000)  # with each kept policy; 0: skip
    stride_steps: int = setting(8, low=1)  # between scored moments
    what_if_stride_steps: int = setting(20, low=1)  # between the moments at which it is told something else
    spoken_episodes: int = setting(10, low=0, high=10_000)  # of those judged, also explained at every step; 0: skip
    horizons_steps: list[int] | None = None  # besides the run's own; null: 20, 40, 60, 100, up to half an episode
    resamples: int = setting(1_000, low=20, high=100_000)  # bootstrap over episodes, for confidence intervals
    shuffles: int = setting(50, low=1, high=10_000)  # negative controls: shuffled instructions, random clusters


@dataclass
class ExplainConfig:
    """An explanation."""

    run: str | None = None  # run folder; None: the newest in runs/
    agent_file: str | None = field(default=None, metadata={"typed": "agent"})  # FILE.zip or MODULE:NAME, not ours
    agent_sees_instruction: bool | None = None  # None: as the external agent or its run folder declares
    agent_vec_normalize: str | None = None  # file of its VecNormalize; loading it runs its code
    agent_frame_stack: int | None = setting(None, low=1, high=1_000)  # observations it reads at once (VecFrameStack)
    episodes: int = setting(200, low=2, high=100_000)  # of the external agent, to learn its vocabulary from
    random_actions: float = setting(0.0, low=0.0, high=1.0)  # share of random actions in these episodes
    run_dir: str = MISSING  # run folder to create for the external agent
    guest_settings: list[str] = field(default_factory=list, metadata={"typed": None})  # env and mapping, as for train
    sweep_dir: str | None = field(default=None, metadata={"typed": "sweep"})  # folder of a sweep to report on instead
    task: str = setting("episode", choices=EXPLAIN_TASKS)  # what to do
    seed: int = setting(0, low=0, high=2**31 - 1)  # of the episode
    context: str | None = None  # of the episode; None: drawn
    min_confidence: float = setting(0.5, low=0.0, high=1.0)  # below this the agent says that it does not know
    what_if: bool = True  # also what it would do if it were told otherwise (task=episode and task=evaluate)
    predictor: PredictorConfig = MISSING
    viewer: ViewerConfig = MISSING
    evaluate: EvaluateConfig = field(default_factory=EvaluateConfig)
    compare: CompareConfig = field(default_factory=CompareConfig)
    figures: FiguresConfig = field(default_factory=FiguresConfig)
    summary: SummaryConfig = field(default_factory=SummaryConfig)
    with_run: str | None = field(default=None, metadata={"typed": "with"})  # run beside it in task=summary
    with_frame: int | None = setting(None, low=0)  # of the agent beside it: the kept policy nearest; None: its newest
    metrics: dict[str, MetricConfig] = field(default_factory=dict)  # beside the run's own; chosen as metric=[NAME,...]
    output: str | None = None  # path of the recording; None: in the run folder
    clip: str | None = None  # path of a moving picture of the episode, FILE.gif or FILE.mp4; None: none
