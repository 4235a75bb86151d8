"""A program of a user's own: an environment that it makes, objects that listen, no file and no command line."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from gates import Gate, task

import ibe_rl
from ibe_rl.config.settings import TrainConfig
from ibe_rl.storage.run_folder import CONFIG, METRICS, read_rows, read_yaml

FEW: dict[str, Any] = {
    "collect": {"processes": 2, "envs_per_process": 4, "steps_per_batch": 128},
    "refresh_every_frames": 2_048,
    "eval_every_frames": 3_000,
    "eval_episodes": 4,
    "mapping": {"horizon_steps": 5, "spans_steps": []},
    "log": {"capacity_frames": 10_000},
    "viewer": "off",
}


def own_env() -> Gate:
    return Gate()


class Hears(ibe_rl.Listener):
    def __init__(self) -> None:
        self.heard: list[str] = []

    def begin(self, run: Any) -> None:
        self.heard.append("begin")

    def refreshed(self, event: Any) -> None:
        self.heard.append("refreshed")

    def end(self, summary: Mapping[str, Any]) -> None:
        self.heard.append("end")


class Words:
    columns = ("mine/words",)

    def __call__(self, event: Any) -> dict[str, float]:
        return {"mine/words": len({one.said for one in event.said})}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Trained in two processes, which are told of an environment that nothing names; then resumed."""
    path, hears = tmp_path_factory.mktemp("own") / "run", Hears()
    own: dict[str, Any] = {"env": lambda: own_env(), "task": task(), "run_dir": path}
    made = ibe_rl.settings("agent.hidden=[16]", total_frames=4_000, **own, **FEW)
    with ibe_rl.build(made, listeners=[hears], metrics=[Words()]) as run:
        assert ibe_rl.train(run)["frames"] == 4_096
    assert hears.heard == ["begin", "refreshed", "refreshed", "end"]
    with ibe_rl.resume(path, "eval_episodes=3", env=own_env, task=task(), listeners=[hears], total_frames=5_000) as run:
        assert (run.resumed, run.cfg.eval_episodes, run.cfg.agent.hidden) == (True, 3, [16])
        assert ibe_rl.train(run)["frames"] == 5_120
    return path


def test_the_folder_holds_the_settings_and_the_name_of_the_environment(folder: Path) -> None:
    saved = read_yaml(folder / CONFIG)
    assert (saved["env"]["given"], saved["env"]["task"], saved["total_frames"]) == (True, None, 5_000)
    assert [bool(row["mine/words"]) for row in read_rows(folder / METRICS)] == [False, True, False, True, False]


def test_it_explains_itself_in_several_processes(folder: Path) -> None:
    opened = ibe_rl.open_run(folder, None, ["predictor.processes=2", "predictor.futures=1"], env=own_env, task=task())
    told = opened.explain(seed=3)
    assert len(told.said) == 40
    assert "Gate: any, 40 steps" in str(told)
    assert opened.clip(folder / "gate.gif", seed=3) == folder / "gate.gif"
    asked = opened.what_if(seed=3, every_steps=15)
    assert [(len(one.what_if), one.phrase) for one in asked] == [(3, told.said[step].phrase) for step in (0, 15, 30)]
    assert all(one.listens is not None and 0 <= one.listens <= 1 for one in asked)
    with pytest.raises(ibe_rl.ConfigError, match="every_steps=0: allowed is at least 1"):
        opened.what_if(every_steps=0)
    with pytest.raises(ibe_rl.ConfigError, match=r"path=.*gate.avi: allowed is a file that ends in .gif or .mp4"):
        opened.clip(folder / "gate.avi")


def test_a_folder_alone_runs_no_code(folder: Path) -> None:
    with pytest.raises(
        ibe_rl.ConfigError, match=r"was given in Python \(test_own_program.own_env\); allowed is to give it"
    ):
        ibe_rl.open_run(folder)
    with pytest.raises(ibe_rl.ConfigError, match="its environment was given in Python"):
        ibe_rl.resume(folder, total_frames=9_000).__enter__()
    with pytest.raises(ibe_rl.ConfigError, match="seed=1 with resume: a run keeps its seed"):
        ibe_rl.resume(folder, env=own_env, task=task(), seed=1).__enter__()
    with pytest.raises(ibe_rl.ConfigError, match="its vocabulary is for 2 state dimensions, not 9"):
        ibe_rl.open_run(folder, env="lander")


def test_an_agent_of_such_an_environment_is_explained(tmp_path: Path) -> None:
    def pushes(states: Any) -> Any:
        return 1 - (states[:, 0] > 0) + (states[:, 0] < 0)

    own = {"env": own_env, "task": task()}
    quick = ["mapping.horizon_steps=5", "mapping.spans_steps=[]", "predictor.futures=1"]
    made = ibe_rl.explain_agent(
        pushes, **own, episodes=12, agent_sees_instruction=False, run_dir=tmp_path / "run", settings=quick
    )
    opened = ibe_rl.open_run(tmp_path / "run", pushes, ["predictor.futures=1"], **own)
    assert str(opened.explain(seed=2)) == str(made.explain(seed=2))
    for refused in (opened.figures, opened.predictors):
        with pytest.raises(ibe_rl.ConfigError, match=r"with agent=: allowed is a run of train.py"):
            refused()


def test_an_id_of_gymnasium_needs_no_file() -> None:
    names = ("x", "vx", "angle", "turning")
    told = task(state_names=names, state_units=("", "", "", ""))
    made = ibe_rl.settings(env="CartPole-v1", task=told, viewer="off")
    assert (made.env.id, made.env.given, made.mapping.horizon_steps) == ("CartPole-v1", True, None)
    plain: TrainConfig = ibe_rl.settings(env="ibe_rl/CartPoleTarget-v0", viewer="off")
    assert (plain.env.id, plain.env.given, plain.mapping.dimensions) == ("ibe_rl/CartPoleTarget-v0", False, [])
    assert ibe_rl.settings(env="cart_pole").mapping.dimensions == [*names[:3], "angular_velocity"]


def test_kinds_need_no_file() -> None:
    agent = {"kind": "dqn", "hidden": [8]}
    made = ibe_rl.settings(env="lander", agent=agent, predictor="ensemble", mapping={"n_clusters": 5})
    assert (made.agent.kind, made.agent.hidden, made.predictor.kind) == ("dqn", [8], "ensemble")
    assert (made.mapping.n_clusters, made.mapping.horizon_steps) == (5, 60)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"env": "nothing"}, "env=nothing: allowed is one of .*cart_pole, .*registered with gymnasium, a function"),
        ({"env": "nowhere:Gate-v0"}, r"env=nowhere:Gate-v0: .*\(nowhere: ModuleNotFoundError"),
        ({"env": "lander", "task": task()}, "task=Gate with env=lander: allowed with it is a gymnasium id"),
        ({"task": task()}, "task=Gate with env=None"),
        ({"total_frames": 0}, "total_frames=0: allowed is at least 1"),
        ({"nothing": 1}, "nothing"),
        ({"resume": "runs/x"}, r"resume=runs/x: allowed in Python is ibe_rl.resume"),
    ],
)
def test_settings_that_cannot_work_are_refused(asked: dict[str, Any], message: str) -> None:
    with pytest.raises(ibe_rl.ConfigError, match=message):
        ibe_rl.settings(**asked)


def test_a_class_in_place_of_a_listener_is_refused() -> None:
    made = ibe_rl.settings(env="lander", viewer="off")
    with pytest.raises(ibe_rl.ConfigError, match=r"listeners=\[Hears\]: a class; allowed are objects, Hears\(...\)"):
        ibe_rl.build(made, listeners=[Hears]).__enter__()


def test_a_gymnasium_object_with_a_task_of_its_own_is_enough() -> None:
    made = ibe_rl.settings(env=gymnasium.make("ibe_rl/CartPoleTarget-v0"), viewer="off")
    assert made.env.given
