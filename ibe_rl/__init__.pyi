"""The public names for type checkers, which do not see what is imported at first use."""

from ibe_rl.api.explained import ExplainedAgent as ExplainedAgent
from ibe_rl.api.explained import Narration as Narration
from ibe_rl.api.explained import explain_agent as explain_agent
from ibe_rl.api.explained import open_run as open_run
from ibe_rl.api.loop import resume as resume
from ibe_rl.api.loop import train as train
from ibe_rl.api.settings import settings as settings
from ibe_rl.apps.minari import export_log as export_log
from ibe_rl.apps.minari import import_log as import_log
from ibe_rl.envs import Instructed as Instructed
from ibe_rl.ibe import ClusterMapping as ClusterMapping
from ibe_rl.ibe import Evidence as Evidence
from ibe_rl.ibe import IBEMapping as IBEMapping
from ibe_rl.ibe import Interpretation as Interpretation
from ibe_rl.ibe import Meaning as Meaning
from ibe_rl.ibe import Reactions as Reactions
from ibe_rl.ibe import cut_windows as cut_windows
from ibe_rl.ibe import delta_states as delta_states
from ibe_rl.ibe import interpret as interpret
from ibe_rl.ibe import phrase as phrase
from ibe_rl.ibe import top_episodes as top_episodes
from ibe_rl.task import Mirror as Mirror
from ibe_rl.task import Phrases as Phrases
from ibe_rl.task import Task as Task
from ibe_rl.training.build import build as build
from ibe_rl.training.run import Run as Run
from ibe_rl.types import ConfigError as ConfigError
from ibe_rl.types import Episode as Episode
from ibe_rl.vocabulary.listener import Listener as Listener

__version__: str
