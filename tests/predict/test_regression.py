"""The regression finds changes that follow from the state, goes straight in between, and asks no policy."""

from pathlib import Path

import numpy as np
import pytest
from cart import POSITION, SPEED, coast, logged, moment

from ibe_rl.predict.regression import Regression, RegressionConfig
from ibe_rl.storage.log import TrajectoryLog


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> TrajectoryLog:
    return logged(tmp_path_factory.mktemp("log"))


def learnt(log: TrajectoryLog, *spans: int, degree: int = 1) -> Regression:
    regression = Regression(RegressionConfig(degree=degree), 0, lambda: spans)
    regression.learn(log)
    return regression


def test_it_foretells_the_mean_of_what_followed(log: TrajectoryLog):
    """Pushes cancel out on average: far from the end a cart goes on as fast as it is."""
    predicted = learnt(log, 5, 10, degree=2).rollout([moment(-1.5, 0.5), moment(-1.5, -0.5)], coast, 10)
    np.testing.assert_allclose(predicted.paths[:, [5, 10], POSITION], [[-1.25, -1.0], [-1.75, -2.0]], atol=0.12)
    assert (predicted.paths[:, 0] == [moment(-1.5, 0.5).state, moment(-1.5, -0.5).state]).all()
    assert np.diff(predicted.paths[0, :6, POSITION]) == pytest.approx(
        np.diff(predicted.paths[0, :2, POSITION])[0], abs=1e-5
    )


def test_beyond_the_longest_span_it_stands_still_and_does_not_stand_by_it(log: TrajectoryLog):
    predicted = learnt(log, 5, 10).rollout([moment(0.0, 1.0)], coast, 14)
    assert predicted.paths.shape == (1, 15, 4)
    assert (predicted.paths[0, 10:] == predicted.paths[0, 10]).all()
    assert predicted.trusted_steps.tolist() == [10]
    assert learnt(log, 5, 10).rollout([moment(0.0)], coast, 7).trusted_steps.tolist() == [7]


def test_its_uncertainty_is_the_share_that_it_cannot_foretell(log: TrajectoryLog):
    near, far = (float(learnt(log, 1, 30).rollout([moment(0.0)], coast, steps).uncertainty[0]) for steps in (1, 30))
    assert 0 < near < far < 1


def test_it_keeps_what_it_has_learnt_in_arrays(log: TrajectoryLog):
    one, other = learnt(log, 5), Regression(RegressionConfig(degree=1), 3, lambda: [5])
    assert other.state_dict() == {}
    other.load_state_dict({})
    other.load_state_dict(one.state_dict())
    one.forget()
    paths, again = (each.rollout([moment(0.3)], coast, 5).paths for each in (one, other))
    np.testing.assert_array_equal(paths, again)
    assert paths[0, -1, SPEED] != paths[0, 0, SPEED]
    one.close()


def test_what_does_not_fit_is_refused(log: TrajectoryLog, tmp_path: Path):
    regression = Regression(RegressionConfig(), 0, lambda: [20, 40])
    with pytest.raises(ValueError, match="not been trained yet"):
        regression.rollout([moment(0.0)], coast, 5)
    with pytest.raises(ValueError, match="no whole episode"):
        regression.learn(TrajectoryLog(tmp_path, 10_000, ["cart"]))
    state = learnt(log, 5).state_dict()
    with pytest.raises(ValueError, match=r"looks \[5\] steps ahead, expected \[20, 40\]"):
        regression.load_state_dict(state)
    with pytest.raises(ValueError, match="its weights have the shape"):
        learnt(log, 5).load_state_dict({**state, "weights": state["weights"][:, :2]})
