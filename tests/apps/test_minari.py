"""Logs go to Minari and come back the same; datasets of others come in; what does not fit is refused."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import h5py
import minari
import numpy as np
import pilots
import pytest
from minari.cli import app
from minari.data_collector import EpisodeBuffer
from torch.utils import _pytree
from typer.testing import CliRunner

from ibe_rl.api.explained import explain_agent, open_run
from ibe_rl.apps.datasets.instruction_source import values_of_words
from ibe_rl.apps.external.folder import external_run_config, keep_run
from ibe_rl.apps.minari import export_log, import_log, minari_command
from ibe_rl.config.command_line import composed
from ibe_rl.envs import LANDER_ID, LANDER_TASK, Instructed
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import create_run_folder, read_json
from ibe_rl.types import ConfigError, Episode

pytestmark = pytest.mark.slow

QUICK = ["mapping.horizon_steps=10", "mapping.spans_steps=[5]", "viewer=off"]
COLUMNS = ("states", "actions", "rewards", "instructions", "given")


@pytest.fixture(autouse=True)
def datasets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))


def made_up(number: int) -> Episode:
    """It drifts the way it is told, at times nothing is said, and the numbers have all their digits."""
    random, steps = np.random.default_rng(number), 20 + number
    instruction = np.repeat(random.integers(-1, 2, steps), 7)[:steps, None].astype(np.float32)
    given = random.random(steps) < 0.8
    states = random.normal(size=(steps + 1, 9)).astype(np.float32)
    states[:, 0] = np.concatenate([[0], 0.03 * instruction[:, 0].cumsum()]) + random.normal(0, 0.003, steps + 1)
    states[:, 8] = (-0.6, 0.0, 0.6)[number % 3]
    return Episode(
        states=states,
        actions=random.integers(0, 4, steps),
        rewards=random.normal(size=steps).astype(np.float32),
        instructions=instruction * given[:, None],
        given=given,
        terminated=number % 2 == 0,
        success=number % 4 == 0,
        context=("left", "center", "right")[number % 3],
    )


@pytest.fixture
def run(tmp_path: Path) -> Path:
    episodes = [made_up(number) for number in range(30)]
    cfg = composed("explain", ["mapping.top_fraction=1", *QUICK, f"run_dir={tmp_path / 'run'}"])
    folder = create_run_folder(tmp_path / "run")
    keep_run(folder, external_run_config(cfg, "a test", seed=0), episodes, sum(len(one) + 1 for one in episodes))
    return folder


def logged(folder: Path) -> list[Episode]:
    log = TrajectoryLog.open(folder / "trajectories")
    return log.read(range(len(log.index)))


def assert_same(one: Episode, other: Episode) -> None:
    for name in COLUMNS:
        mine, theirs = getattr(one, name), getattr(other, name)
        assert (mine.dtype, mine.tobytes()) == (theirs.dtype, theirs.tobytes()), name
    assert (one.terminated, one.success, one.context) == (other.terminated, other.success, other.context)


def test_a_round_trip_is_equal(run: Path, tmp_path: Path) -> None:
    export_log(run, "mine/log-v0")
    back = import_log("mine/log-v0", ["mapping.top_fraction=1", *QUICK, f"run_dir={tmp_path / 'back'}"])
    before, after = logged(run), logged(back)
    assert len(before) == len(after) == 30
    for number, (one, other) in enumerate(zip(before, after, strict=True)):
        assert_same(one, made_up(number))
        assert_same(one, other)
    refreshes = [next((folder / "refreshes").glob("*.json")).read_text() for folder in (run, back)]
    assert refreshes[0] == refreshes[1]
    assert len(str(open_run(back, pilots.pilot, ["agent_sees_instruction=false", *QUICK]).explain(seed=1))) > 1_000


def test_an_import_that_fails_leaves_nothing_and_is_not_refused_again(run: Path, tmp_path: Path) -> None:
    export_log(run, "mine/log-v0")
    asked = [*QUICK, f"run_dir={tmp_path / 'back'}", "mapping.window_end=drop"]
    for _ in range(2):
        with pytest.raises(ConfigError, match="no vocabulary can be learnt from them"):
            import_log("mine/log-v0", [*asked, "mapping.horizon_steps=900"])
        assert not list(tmp_path.glob("back*"))
    assert import_log("mine/log-v0", asked) == tmp_path / "back"


def test_an_export_that_is_killed_leaves_no_dataset(run: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A dataset that is being made lies where Minari does not look; then it has its name as a whole."""
    real = minari.create_dataset_from_buffers

    def create(*arguments: Any, **about: Any) -> Any:
        made = real(*arguments, **about)
        with monkeypatch.context() as patch:
            patch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
            assert minari.list_local_datasets() == {}
        return made

    monkeypatch.setattr(minari, "create_dataset_from_buffers", create)
    assert export_log(run, "mine/log-v0").total_episodes == 30
    assert [*minari.list_local_datasets()] == ["mine/log-v0"]
    assert sorted(path.name for path in (tmp_path / "datasets").iterdir()) == ["mine"]
    assert minari.namespace.list_local_namespaces() == ["mine"]


def test_an_export_that_fails_leaves_nothing_and_is_not_refused_again(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise OSError("no space left on the device")

    with monkeypatch.context() as patch:
        patch.setattr(minari.utils, "MinariDataset", full)  # what is made last
        with pytest.raises(ConfigError, match=r"^dataset=mine/\S+: no space left"):
            export_log(run, "mine/log-v0")
    assert export_log(run, "mine/log-v0").total_episodes == 30
    with pytest.raises(ConfigError, match=r"dataset=mine/log-v0: .*already exists"):
        export_log(run, "mine/log-v0")
    assert minari.load_dataset("mine/log-v0").total_episodes == 30


def test_minaris_own_tools_read_it(run: Path) -> None:
    export_log(run, "mine/some-v0", newest=7)
    dataset = minari.load_dataset("mine/some-v0")
    assert (dataset.total_episodes, dataset.total_steps) == (7, sum(20 + number for number in range(23, 30)))
    assert dataset.env_spec.id == LANDER_ID
    assert dataset.observation_space == gymnasium.make(LANDER_ID).observation_space
    assert dataset.recover_environment().unwrapped.task is LANDER_TASK
    for data, number in zip(dataset.iterate_episodes(), range(23, 30), strict=True):
        np.testing.assert_array_equal(data.observations, made_up(number).states)
        assert bool(data.terminations[-1]) != bool(data.truncations[-1])
        assert all(len(column) == len(data) + 1 for column in data.infos.values())
    assert len(dataset.sample_episodes(3)) == 3
    assert dataset.filter_episodes(lambda one: one.infos["success"][-1]).total_episodes == 2
    shown = CliRunner().invoke(app, ["show", "mine/some-v0"])
    assert shown.exit_code == 0
    assert LANDER_ID in shown.stdout


def test_an_environment_that_a_config_declares_goes_out_and_comes_in(tmp_path: Path) -> None:
    made = explain_agent(pilots.reach, "reacher", episodes=12, agent_sees_instruction=False, run_dir=tmp_path / "arm")
    dataset = export_log(made.run.folder, "mine/arm-v0")
    assert dataset.recover_environment().unwrapped.spec.id == "Reacher-v5"
    folder = import_log("mine/arm-v0", ["env=reacher", f"run_dir={tmp_path / 'back'}"])
    for one, other in zip(logged(folder), logged(made.run.folder), strict=True):
        assert_same(one, other)
    seeds = [read_json(path / "seeds.json")["seeds"] for path in (folder, made.run.folder)]
    assert seeds[0] == seeds[1]
    assert len(set(seeds[0])) == 12
    again = gymnasium.make("Reacher-v5").reset(seed=seeds[0][5])[0]
    np.testing.assert_array_equal(logged(folder)[5].states[0], again.astype(np.float32))
    words = {word.decode() for one in dataset for word in one.infos["instruction_words"].tolist()}
    assert words <= {*values_of_words(made.run.task), ""}
    (folder / "seeds.json").write_text('{"seeds": [1]}')  # of another log
    assert next(export_log(folder, "mine/twice-v0").storage.get_episode_metadata([0])).get("seed") is None
    (folder / "seeds.json").write_text("{}")
    with pytest.raises(ConfigError, match=r"seeds.json: not readable seeds"):
        export_log(folder, "mine/thrice-v0")


def goal_last(observation: dict[str, np.ndarray]) -> np.ndarray:
    return np.concatenate([observation["position"], observation["goal"]])


def make_of_parts(name: str) -> None:
    """As a goal-conditioned environment: position and goal apart, and an image that nobody needs."""
    spaces: Any = gymnasium.spaces
    parts = {"position": (8,), "goal": (1,), "camera": (2, 2)}
    space = spaces.Dict({key: spaces.Box(-np.inf, np.inf, shape) for key, shape in parts.items()})
    buffers = []
    for number in range(30):
        one = made_up(number)
        seen = {"position": one.states[:, :8], "goal": one.states[:, 8:], "camera": np.zeros((len(one) + 1, 2, 2))}
        flags = np.arange(len(one)) == len(one) - 1
        infos = {"instruction": np.append(one.instructions, [[0]], axis=0)}
        buffers.append(EpisodeBuffer(None, 7, None, seen, one.actions, one.rewards, flags, flags & False, infos))
    minari.create_dataset_from_buffers(name, buffers, observation_space=space, action_space=spaces.Discrete(4))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_observations_of_parts_come_in_by_a_function(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_of_parts("by/parts-v0")
    settings = ["mapping.top_fraction=1", *QUICK, f"run_dir={tmp_path / 'parts'}"]
    with pytest.raises(ConfigError, match=r"observations are Dict\('camera'.*or --state=MODULE:NAME, one observation"):
        import_log("by/parts-v0", settings)
    with pytest.raises(ConfigError, match=r"--state=test_minari:nothing: allowed is module:function"):
        import_log("by/parts-v0", settings, state="test_minari:nothing")
    with pytest.raises(ConfigError, match=r"episode 0: the function of --state raised TypeError.*allowed is one obser"):
        import_log("by/parts-v0", settings, state="test_minari:logged")
    assert minari_command(["import", "by/parts-v0", *settings, "--state", "test_minari:goal_last"]) == 0
    assert "30 of 30 episodes have no info that says whether they succeeded" in capsys.readouterr().out
    for number, episode in enumerate(logged(tmp_path / "parts")):
        np.testing.assert_array_equal(episode.states, made_up(number).states)
    assert read_json(tmp_path / "parts" / "seeds.json") == {"seeds": [7] * 30}


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_nothing_of_a_failed_import_or_export_stays(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make("by/two-v0", instruction=lambda one: np.full(30, np.nan if len(one) == 25 else 1.0))
    before = set(tmp_path.rglob("*"))
    for _ in range(2):
        with pytest.raises(ConfigError, match=r"episode 5: infos\['instruction'\] ranges from nan to nan; allowed are"):
            import_log("by/two-v0", [*QUICK, f"run_dir={tmp_path / 'two'}"])
        assert set(tmp_path.rglob("*")) == before
    make("by/few-v0", count=2)
    short = ["mapping.horizon_steps=1000", "mapping.window_end=drop"]
    with pytest.raises(ConfigError, match="episodes=2: no vocabulary can be learnt"):
        import_log("by/few-v0", [*QUICK, *short, f"run_dir={tmp_path / 'few'}"])
    with pytest.raises(ConfigError, match="holds a run already"):
        import_log("by/few-v0", [*QUICK, f"run_dir={run}"])
    assert not (tmp_path / "few").exists()
    with pytest.raises(ConfigError, match="dataset=no name: Malformed dataset ID"):
        export_log(run, "no name")
    assert not (tmp_path / "datasets" / "no name").exists()

    def breaks(name: str, *_: Any, **__: Any) -> None:
        Path(os.environ["MINARI_DATASETS_PATH"], name, "data").mkdir(parents=True)
        raise ValueError("no space")

    before = set(tmp_path.rglob("*"))

    monkeypatch.setattr(minari, "create_dataset_from_buffers", breaks)
    with pytest.raises(ConfigError, match="dataset=mine/broken-v0: no space"):
        export_log(run, "mine/broken-v0")
    assert set(tmp_path.rglob("*")) == before


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_damaged_dataset_ends_in_one_line(tmp_path: Path) -> None:
    make("by/torn-v0")
    with h5py.File(tmp_path / "datasets" / "by" / "torn-v0" / "data" / "main_data.hdf5", "a") as file:
        del file["episode_3/rewards"]
    with pytest.raises(ConfigError, match=r"dataset=by/torn-v0, episode 3: it cannot be read .KeyError"):
        import_log("by/torn-v0", [*QUICK, f"run_dir={tmp_path / 'torn'}"])
    assert not (tmp_path / "torn").exists()


@pytest.fixture
def collected(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Minari's own collector, which takes one function from jax: here torch's of the same name."""
    jax, tree = ModuleType("jax"), ModuleType("jax.tree_util")
    tree.tree_map = _pytree.tree_map
    jax.tree_util = tree
    monkeypatch.setitem(sys.modules, "jax", jax)
    monkeypatch.setitem(sys.modules, "jax.tree_util", tree)

    def collect(name: str, env: gymnasium.Env[Any, Any], count: int = 8) -> None:
        collector = minari.DataCollector(env, record_infos=True)
        for seed in range(count):
            state, _ = collector.reset(seed=seed)
            ended = False
            while not ended:
                state, _, terminated, truncated, _ = collector.step(pilots.pilot(state[:9]))
                ended = terminated or truncated
        collector.create_dataset(dataset_id=name)

    return collect


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_dataset_of_others_comes_in_with_the_rule_of_the_environment(collected: Any, tmp_path: Path) -> None:
    collected("theirs/flights-v0", gymnasium.make(LANDER_ID))
    settings = [*QUICK, f"run_dir={tmp_path / 'rule'}"]
    assert minari_command(["import", "theirs/flights-v0", "--instruction", "rule", *settings]) == 0
    episodes, dataset = logged(tmp_path / "rule"), minari.load_dataset("theirs/flights-v0")
    assert len(episodes) == 8
    for episode, data in zip(episodes, dataset, strict=True):
        np.testing.assert_array_equal(episode.states, data.observations)
        np.testing.assert_array_equal(episode.instructions, LANDER_TASK.rule(episode.states[:-1]))
        assert episode.success == data.infos["landed"][-1]
        assert episode.context == LANDER_TASK.context(episode.states[0])
    assert any(episode.success for episode in episodes)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_what_was_said_is_taken_from_the_observations_of_who_was_instructed(collected: Any, tmp_path: Path) -> None:
    collected("theirs/told-v0", Instructed(gymnasium.make(LANDER_ID, pad="left")), 4)
    folder = import_log("theirs/told-v0", [*QUICK, f"run_dir={tmp_path / 'told'}"])
    for episode, data in zip(logged(folder), minari.load_dataset("theirs/told-v0"), strict=True):
        np.testing.assert_array_equal(episode.states, data.observations[:, :9])
        np.testing.assert_array_equal(episode.instructions, data.observations[:-1, 9:10])
        assert episode.given.all()
        assert episode.context == "left"


def make(name: str, observations: int = 9, actions: int = 4, count: int = 12, **infos: Any) -> None:
    """A dataset by hand, of episodes of 30 steps."""
    buffers = []
    for number in range(count):
        one = made_up(number)
        states = np.resize(one.states, (31, observations))
        flags = np.arange(30) == 29
        said = {key: made(one) for key, made in infos.items()}
        buffers.append(
            EpisodeBuffer(None, None, None, states, np.zeros(30, int), np.ones(30), flags, ~flags & flags, said)
        )
    spaces: Any = gymnasium.spaces
    box = spaces.Box(-np.inf, np.inf, (observations,), np.float32)
    minari.create_dataset_from_buffers(name, buffers, observation_space=box, action_space=spaces.Discrete(actions))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_the_key_of_the_instruction_can_be_named(tmp_path: Path) -> None:
    make("by/hand-v0", command=lambda one: np.full(30, 1.0 - one.actions[0] % 3))
    folder = import_log("by/hand-v0", [*QUICK, f"run_dir={tmp_path / 'named'}"], "command")
    for number, episode in enumerate(logged(folder)):
        np.testing.assert_array_equal(episode.instructions, np.full((30, 1), 1.0 - made_up(number).actions[0] % 3))
        assert not episode.success
        assert episode.terminated
    make("by/rule-v0", instruction=lambda _: np.zeros(31))
    ruled = import_log("by/rule-v0", [*QUICK, f"run_dir={tmp_path / 'ruled'}"], "rule")
    assert any(episode.instructions.any() for episode in logged(ruled))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_what_does_not_fit_is_refused_before_a_folder_is_made(tmp_path: Path) -> None:
    def refused(message: str, name: str, key: str | None = None) -> None:
        with pytest.raises(ConfigError, match=message):
            import_log(name, [*QUICK, f"run_dir={tmp_path / 'none'}"], key)
        assert not (tmp_path / "none").exists()

    make("by/small-v0", observations=8)
    make("by/many-v0", actions=5)
    make(
        "by/short-v0",
        instruction=lambda _: np.zeros(7),
        large=lambda _: np.full(30, 2.0),
        two=lambda _: np.ones((30, 2)),
    )
    make("by/none-v0", count=0)
    refused(r"observations are of shape \(8,\); allowed is \(9,\), the state, or \(11,\)", "by/small-v0")
    refused(r"dataset=by/many-v0: its actions are Discrete\(5\)", "by/many-v0")
    refused(r"episode 0: infos\['instruction'\] has the shape \(7, 1\) in an episode of 30 steps", "by/short-v0")
    refused(r"infos\['two'\] has the shape \(30, 2\)", "by/short-v0", "two")
    refused(r"infos\['large'\] ranges from 2 to 2; allowed are numbers from -1 to 1", "by/short-v0", "large")
    refused("instruction=other: allowed are instruction, large, two of its infos, or rule", "by/short-v0", "other")
    make("by/one-v0", count=1)
    refused("it has no episode; allowed are at least 2", "by/none-v0")
    refused("it has 1 episode; allowed are at least 2", "by/one-v0")
    refused("dataset=by/absent-v0: no dataset of Minari on this machine has that name; allowed", "by/absent-v0")
    refused("dataset=text.npy: .*Malformed|dataset=text.npy: no dataset of Minari", "text.npy")
    (tmp_path / "datasets" / "by" / "small-v0" / "data" / "metadata.json").write_text("{}")
    refused("dataset=by/small-v0: it cannot be read", "by/small-v0")


def test_what_cannot_be_exported_is_refused(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert minari_command(["export", str(run), "mine/twice-v0", "--newest", "2"]) == 0
    with pytest.raises(SystemExit, match=r"error: dataset=mine/twice-v0: .*already exists"):
        minari_command(["export", str(run), "mine/twice-v0"])
    with pytest.raises(ConfigError, match="newest=0: allowed is at least 1"):
        export_log(run, "mine/other-v0", newest=0)
    with pytest.raises(ConfigError, match="not a run folder"):
        export_log(tmp_path, "mine/other-v0")
    (run / "trajectories" / "log.json").unlink()
    with pytest.raises(ConfigError, match="is not a readable log"):
        export_log(run, "mine/other-v0")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ConfigError, match=r"install the extra ibe_rl\[minari\]"):
        export_log(run, "mine/other-v0")
