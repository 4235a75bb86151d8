"""One kind of each group, as a person would write it: a module and a YAML file."""

from pathlib import Path

MAPPING = '''
from dataclasses import dataclass, replace
import numpy as np
from ibe_rl.config.limits import setting
from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe import IBEConfig, IBEMapping

@dataclass
class LoudConfig(MappingConfig):
    loudness: float = setting(1.0, low=0.5, high=2.0)

class Loud:
    """As the paper's, in other words."""

    settings = LoudConfig

    def __init__(self, n_clusters, loudness, random_state):
        self.inner, self.loudness = IBEMapping(n_clusters, random_state=random_state), loudness

    def fit(self, delta, instruction, states=None, state_instructions=None, interpretation=None):
        found = self.inner.fit(delta, instruction).mapping_
        self.mapping_ = replace(found, expressions=np.clip(self.loudness * found.expressions, -1, 1))
        return self

@dataclass
class StretchedConfig(IBEConfig):
    stretch: float = setting(1.0, low=0.5, high=2.0)

class Stretched(IBEMapping):
    """Has all settings of the mappings that come along, and one more."""

    settings = StretchedConfig

    def __init__(self, stretch=1.0, n_clusters=8, space="all", split="kmeans", power=1.0, symmetric=False,
                 normalisation="minmax", membership="hard", weigh_followed=False, hidden=(32, 32), n_init=4, last=None,
                 memory=0.0, max_fit_windows=20_000, dimensions=None, random_state=None):
        super().__init__(n_clusters, space, split, power, symmetric, normalisation, membership, weigh_followed,
                         dimensions, hidden, n_init, last, memory, max_fit_windows, random_state)
        self.stretch = stretch
'''
PREDICTOR = '''
from dataclasses import dataclass
import numpy as np
from ibe_rl.config.limits import setting
from ibe_rl.config.settings import PredictorConfig
from ibe_rl.types import Prediction, columns_of

@dataclass
class StillConfig(PredictorConfig):
    drift: float = setting(0.01, low=0.0, high=1.0, kept=True)

class Still:
    """Nearly nothing moves."""

    settings, learns = StillConfig, True

    def __init__(self, config, **_):
        self.drift, self.times = config.drift, 0

    def rollout(self, moments, policy, horizon_steps):
        ahead = self.drift * np.arange(horizon_steps + 1, dtype=np.float32)[:, None]
        return Prediction.exact(columns_of(moments)[0][:, None] + ahead)

    def learn(self, log, until_frame=None):
        self.times += 1

    def forget(self): pass
    def close(self): pass
    def state_dict(self): return {"times": self.times}
    def load_state_dict(self, state): self.times = int(state["times"])
'''
AGENT = """
from dataclasses import dataclass
from ibe_rl.agents.ppo import PPO, PPOConfig
from ibe_rl.config.limits import setting

@dataclass
class ShyConfig(PPOConfig):
    shyness: float = setting(0.5, low=0.0, high=1.0)

class Shy(PPO):
    settings = ShyConfig
"""
INSTRUCTOR = """
from dataclasses import dataclass
import numpy as np
from ibe_rl.config.limits import setting
from ibe_rl.config.settings import InstructorConfig

@dataclass
class SometimesConfig(InstructorConfig):
    every_steps: int = setting(1, low=1, high=9)

class Sometimes:
    settings = SometimesConfig

    def __init__(self, config, task, seed):
        self.rule, self.every = task.rule, config.every_steps

    def reset(self, rows): self.step = 0

    def instruct(self, states, rows):
        self.step += 1
        given = np.full((len(rows), 1), self.step % self.every == 0, np.float32)
        return self.rule(states) * given, given
"""
LISTENER = """
from dataclasses import dataclass
from ibe_rl.config.limits import setting
from ibe_rl.config.settings import ListenerConfig
from ibe_rl.vocabulary.listener import Listener

@dataclass
class DiaryConfig(ListenerConfig):
    name: str = "diary.txt"
    every_batches: int = setting(2, low=1)

class Diary(Listener):
    settings = DiaryConfig

    def __init__(self, config): self.config, self.batches = config, 0
    def begin(self, run): self.path = run.folder / self.config.name

    def batch(self, frames, row):
        self.batches += 1
        if self.batches % self.config.every_batches == 0:
            with self.path.open("a") as stream:
                stream.write(f"{frames}\\n")
"""
METRIC = """
from dataclasses import dataclass
from ibe_rl.config.limits import setting
from ibe_rl.config.settings import MetricConfig
from ibe_rl.metrics.bootstrap import weighted_mean
from ibe_rl.vocabulary.listener import Metric

@dataclass
class DistinctConfig(MetricConfig):
    share: float = setting(1.0, low=0.0, high=1.0)

class Distinct(Metric):
    settings, columns = DistinctConfig, ("mine/words",)

    def __init__(self, config): self.share = config.share
    def __call__(self, event): return {"mine/words": self.share * len({one.phrase for one in event.said})}

    def score(self, statements):
        right = (statements.said * statements.truth.change).min(axis=1) > 0
        return {"mine/right": self.share * weighted_mean(right, statements.truth.weights)}
"""
ENV = """
from dataclasses import dataclass
import gymnasium
from ibe_rl.config.limits import setting
from ibe_rl.envs.cart_pole import CartPoleTarget

@dataclass
class WindyConfig:
    wind: float = setting(0.0, low=0.0, high=0.1)

class Windy(CartPoleTarget):
    settings = WindyConfig

    def __init__(self, wind, **kwargs):
        super().__init__(**kwargs)
        self.wind = wind

gymnasium.register("Windy-v0", entry_point=Windy, max_episode_steps=500)
"""
KINDS = {
    "mapping": (MAPPING, "kind: {module}:Loud\nloudness: 1.5\n"),
    "predictor": (PREDICTOR, "kind: {module}:Still\n"),
    "agent": (AGENT, "kind: {module}:Shy\nhidden: [16]\n"),
    "instructor": (INSTRUCTOR, "# @package _global_\ninstructor:\n  kind: {module}:Sometimes\nmin_confidence: 0.4\n"),
    "listener": (LISTENER, "kind: {module}:Diary\n"),
    "metric": (METRIC, "kind: {module}:Distinct\n"),
    "env": (ENV, "id: {module}:Windy-v0\nkwargs:\n  wind: 0.01\n"),
}


def write_kinds(folder: Path) -> None:
    """Two files for each kind: ``kinds_of_mine/GROUP.py`` and ``mine/GROUP/mine.yaml``."""
    for group, (module, settings) in KINDS.items():
        for path, text in (
            (folder / "kinds_of_mine" / f"{group}.py", module),
            (folder / "mine" / group / "mine.yaml", settings.format(module=f"kinds_of_mine.{group}")),
        ):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
