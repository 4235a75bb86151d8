"""With a policy that stands still, all that moves between refreshes is the explainer's own noise."""

from pathlib import Path
from typing import Any

import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from benchmarks.refilling import steps_of_episode
from ibe_rl.collect.rollout import play
from ibe_rl.config.kind_files import register
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.evaluation.runs import load_run
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.instructors import make_instructor
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Episode
from ibe_rl.vocabulary.refresh import Refresh
from ibe_rl.vocabulary.tracker import VocabularyTracker

pytestmark = pytest.mark.slow

DEMO = Path(__file__).parent.parent / "demo"
REFRESHES, EPISODES = 3, 320
FIRST_SEED = 700_000


def logged(folder: Path, contexts: tuple[str, ...], episodes: list[Episode]) -> TrajectoryLog:
    """A log of these whole episodes."""
    log = TrajectoryLog(folder, sum(len(episode) + 1 for episode in episodes), contexts)
    for number, episode in enumerate(episodes):
        log.add(steps_of_episode(episode, number), lambda _, name=episode.context: name)
    return log


@pytest.fixture(scope="module")
def run() -> TrainedRun:
    return load_run(DEMO)


@pytest.fixture(scope="module")
def logs(run: TrainedRun, tmp_path_factory: pytest.TempPathFactory) -> list[TrajectoryLog]:
    """Logs, each of new episodes of the demo's policy."""
    envs = [run.make_env() for _ in range(64)]
    instructor = make_instructor(InstructorConfig("oracle"), run.task)
    firsts = range(FIRST_SEED, FIRST_SEED + REFRESHES * EPISODES, EPISODES)
    rolled_out = [play(envs, run.policy, instructor, range(first, first + EPISODES)) for first in firsts]
    return [logged(tmp_path_factory.mktemp("log"), run.task.contexts, episodes) for episodes in rolled_out]


@pytest.fixture(scope="module", params=["paper", "axis"])
def refreshes(request: pytest.FixtureRequest, run: TrainedRun, logs: list[TrajectoryLog]) -> list[Refresh]:
    """The vocabulary learnt from each of them, one after the other, as the mapping of this name does it."""
    register()
    with initialize_config_dir(str(DEMO.parent / "configs"), version_base="1.3"):
        chosen: Any = OmegaConf.to_object(compose("train", [f"mapping={request.param}"]))
    development = VocabularyTracker(chosen.mapping, run.task, seed=0)
    return [development.refresh(log, run.policy) for log in logs]


def test_the_policy_did_not_move(refreshes: list[Refresh]) -> None:
    assert [refresh.change.policy_drift for refresh in refreshes[1:] if refresh.change] == [0.0] * (REFRESHES - 1)


def test_the_vocabulary_hardly_does(refreshes: list[Refresh]) -> None:
    """The explainer's own noise; docs/LOG.md has it for larger refreshes and other policies."""
    changes = [refresh.change for refresh in refreshes[1:] if refresh.change]
    agreement = [change.drift.cluster_agreement for change in changes]
    renamed = [change.drift.phrase_changed for change in changes]
    assert len(changes) == REFRESHES - 1
    assert min(agreement) >= 0.95, agreement
    assert max(renamed) <= 0.05, renamed


def test_all_clusters_survive(refreshes: list[Refresh]) -> None:
    ids = {tuple(sorted(refresh.mapping.ids.tolist())) for refresh in refreshes}
    assert ids == {tuple(range(8))}


def test_the_episodes_were_others_each_time(refreshes: list[Refresh]) -> None:
    assert len({refresh.top.delta.tobytes() for refresh in refreshes}) == REFRESHES
