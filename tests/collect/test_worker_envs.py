"""What goes wrong with an environment in a worker reaches the trainer as one message."""

from types import SimpleNamespace

import pytest
import torch
from awkward import behind_gate
from tensordict import TensorDict

from ibe_rl.collect.worker_envs import WorkerEnvs, raise_child_error
from ibe_rl.envs.errors import GateError
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.runtime.child_errors import ChildErrors


def test_a_worker_leaves_the_error_and_ends_without_a_traceback():
    child_errors, env = ChildErrors(), behind_gate(lambda *_: 1 / 0)
    collector = SimpleNamespace(child_errors=child_errors)
    raise_child_error(collector)
    envs = WorkerEnvs([env], Oracle(task_of(env).rule), (), child_errors.folder)
    start = envs.reset()
    with pytest.raises(SystemExit) as ended:
        envs.step(start.update(TensorDict({"action": torch.ones(1, dtype=torch.long)}, [1])))
    assert ended.value.code == 1
    with pytest.raises(
        GateError, match=r"^env\.id=lift, episode of seed \d+, step 1: its step\(\) raised ZeroDivision"
    ):
        raise_child_error(collector)


def test_a_reset_too():
    child_errors, env = ChildErrors(), behind_gate(context=lambda _: "beside")
    with pytest.raises(SystemExit):
        WorkerEnvs([env], Oracle(task_of(env).rule), (), child_errors.folder).reset()
    assert "returned 'beside'" in str(child_errors.first())
