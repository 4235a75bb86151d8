"""What is declared of gymnasium's classic control, against hand-made states and the real games."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from ibe_rl.api.explained import explain_agent
from ibe_rl.envs import classic_control as classic
from ibe_rl.types import Array


def in_state(name: str, *state: float) -> tuple[Any, Array]:
    """A game in a state of its own, and what it observes there."""
    game: Any = gymnasium.make(name, disable_env_checker=True).unwrapped
    game.reset(seed=0)
    game.state = np.array(state)
    observe = {"Pendulum-v1": "_get_obs", "Acrobot-v1": "_get_ob"}.get(name)
    return game, getattr(game, observe)() if observe else game.state


@pytest.mark.parametrize(
    ("angle", "speed", "energy", "said"),
    [(0.0, 0.0, 5.0, 0), (np.pi, 0.0, -5.0, 1), (np.pi / 2, 6.0, 6.0, -1), (np.pi, np.sqrt(60), 5.0, 0)],
)
def test_the_pendulum_is_told_to_have_the_energy_that_stands(angle: float, speed: float, energy: float, said: int):
    state = classic.pendulum_state(*in_state("Pendulum-v1", angle, speed))
    np.testing.assert_allclose(state[-1], energy, atol=1e-4)
    assert classic.swing_to_upright(state).tolist() == [said]
    np.testing.assert_allclose(classic.short_of_upright(state), [5 - energy], atol=1e-4)


def test_a_pendulum_is_balanced_upright_and_still_at_the_end():
    upright, fast, hanging = np.array([(1.0, 0.0, 0.1, 5.0), (1.0, 0.0, 1.0, 5.2), (-1.0, 0.0, 0.0, -5.0)])
    assert classic.balanced(upright, False, True)
    assert not classic.balanced(upright, False, False)
    assert not classic.balanced(fast, False, True)
    assert not classic.balanced(hanging, False, True)


@pytest.mark.parametrize(
    ("x", "velocity", "energy", "said"),
    [(-np.pi / 6, 0.0, -1.0, 1), (np.pi / 6, 0.0, 1.0, 1), (-np.pi / 6, 0.06, 1.16, 0), (0.0, -0.05, 1.5, 0)],
)
def test_the_car_is_told_to_swing_more_until_it_can_roll_up(x: float, velocity: float, energy: float, said: int):
    state = classic.car_state(*in_state("MountainCar-v0", x, velocity))
    np.testing.assert_allclose(state, [x, velocity, energy], atol=1e-6)
    assert classic.swing_to_the_hill(state).tolist() == [said]


def test_a_car_with_the_energy_rolls_up_by_itself_and_one_without_does_not():
    for velocity, there in [(0.06, True), (0.057, False)]:
        game, observation = in_state("MountainCar-v0", -np.pi / 6, velocity)
        assert classic.swing_to_the_hill(classic.car_state(game, observation))[0] == (not there)
        assert any(game.step(1)[2] for _ in range(200)) == there


@pytest.mark.parametrize(
    ("state", "energy", "said"),
    [((0, 0, 0, 0), -19.6, 1), ((np.pi, 0, 0, 0), 19.6, 0), ((0, 0, 0, 8.0), 20.4, 0), ((0, np.pi, 1, 0), -8.55, 1)],
)
def test_the_acrobot_is_told_to_swing_more_until_its_tip_can_get_up(state: Any, energy: float, said: int):
    found = classic.acrobot_state(*in_state("Acrobot-v1", *state))
    np.testing.assert_allclose(found[-1], energy, atol=1e-4)
    assert classic.swing_the_tip_up(found).tolist() == [said]


def test_the_energy_of_an_acrobot_without_torque_stays():
    game, observation = in_state("Acrobot-v1", 1.0, 0.5, 0.0, 0.0)
    energies = [classic.acrobot_state(game, observation)[-1]]
    energies += [classic.acrobot_state(game, game.step(1)[0])[-1] for _ in range(15)]
    assert np.ptp(energies) < 0.05


def test_what_ended_before_the_time_limit_arrived():
    assert classic.arrived(np.zeros(3), True, False)
    assert not classic.arrived(np.zeros(3), False, True)


def push_along(observations: Array) -> Array:
    """A driver of the mountain car: observations ``(N, 2)`` to actions ``(N,)``, as it rolls."""
    return np.where(observations[:, 1] < 0, 0, 2)


def test_a_car_that_arrives_says_that_it_swings_more(tmp_path: Path):
    made = explain_agent(
        push_along,
        "mountain_car",
        episodes=40,
        random_actions=0.3,
        agent_sees_instruction=False,
        run_dir=tmp_path / "car",
    )
    meaning = made.run.mapping.meanings[0]
    assert (meaning.positive, meaning.negative) == (True, False)  # it is never told to swing less
    said = {one.phrase for one in made.explain(seed=1).said}
    assert "swinging more" in said
    assert not any("less" in phrase for phrase in said)
