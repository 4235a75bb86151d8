"""What is declared of MiniGrid's mazes, against real ones."""

from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
from minigrid.core import grid as grids
from minigrid.core import world_object as objects

from ibe_rl.config.command_line import composed
from ibe_rl.config.settings import EnvConfig
from ibe_rl.envs import minigrid
from ibe_rl.envs.make import make_env
from ibe_rl.envs.snapshots import stoppable
from ibe_rl.envs.trial import try_out
from ibe_rl.envs.wrappers import task_of

EAST, SOUTH, WEST, NORTH = range(4)
LEFT, RIGHT, FORWARD = range(3)
ACTION = {-1: LEFT, 0: FORWARD, 1: RIGHT}


def maze(*rows: str) -> Any:
    """A grid drawn with # for wall, G for goal, L for lava."""
    made = {"#": objects.Wall, "G": objects.Goal, "L": objects.Lava}
    grid = grids.Grid(len(rows[0]), len(rows))
    for y, row in enumerate(rows):
        for x, letter in enumerate(row):
            grid.set(x, y, made[letter]() if letter in made else None)
    return grid


def at(grid: Any, place: tuple[int, int], direction: int) -> Any:
    return SimpleNamespace(grid=grid, width=grid.width, height=grid.height, agent_pos=place, agent_dir=direction)


ROOM = maze("#####", "#  G#", "#   #", "#####")
BARRED = maze("######", "#  #G#", "#  L #", "#    #", "######")
WAYS = [
    (ROOM, (1, 1), EAST, 0, 2),
    (ROOM, (1, 1), SOUTH, -1, 3),
    (ROOM, (1, 1), NORTH, 1, 3),
    (ROOM, (1, 1), WEST, 1, 4),  # behind: to the right
    (ROOM, (1, 2), EAST, 0, 4),  # two ways are as short: ahead as long as it may
    (ROOM, (3, 1), WEST, 0, 0),  # there
    (BARRED, (2, 1), SOUTH, 0, 8),  # around wall and lava: two down, left, two ahead, left, two up
    (BARRED, (3, 2), EAST, 0, -1),  # in lava, where the episode ends
]


@pytest.mark.parametrize(("grid", "place", "direction", "turn", "steps"), WAYS)
def test_the_way_is_a_shortest_one_by_turns_and_steps(
    grid: Any, place: tuple[int, int], direction: int, turn: int, steps: int
):
    state = minigrid.maze_state(at(grid, place, direction), None)
    np.testing.assert_array_equal(state, [place[0], grid.height - 1 - place[1], direction, direction + turn, steps])
    assert minigrid.maze_instruction(state).tolist() == [turn]


def test_headings_are_counted_on():
    game, seen = at(ROOM, (1, 2), NORTH), []
    for direction in (NORTH, EAST, SOUTH, WEST, NORTH, WEST, SOUTH):
        game.agent_dir = direction
        seen.append(minigrid.maze_state(game, None)[minigrid.HEADING])
        assert minigrid.maze_state(game, None)[minigrid.HEADING] == seen[-1]  # asking twice changes nothing
    assert seen == [3, 4, 5, 6, 7, 6, 5]
    game.grid = maze("#####", "#  G#", "#   #", "#####")  # another episode
    assert minigrid.maze_state(game, None)[minigrid.HEADING] == SOUTH


def test_a_maze_without_a_way_is_refused():
    with pytest.raises(ValueError, match="no way leads to a goal; mazes with doors"):
        minigrid.maze_state(at(maze("#####", "# #G#", "#####"), (1, 1), EAST), None)


def test_arrived_is_at_the_goal():
    there, elsewhere = np.array([3.0, 2, 0, 0, 0]), np.array([1.0, 2, 0, 0, 2])
    assert minigrid.at_goal(there, True, False)
    assert not minigrid.at_goal(elsewhere, True, False)  # in lava
    assert not minigrid.at_goal(elsewhere, False, True)
    assert [minigrid.maze_distance(np.array([0, 0, 0, 0, steps])) for steps in (12, 13)] == ["near", "far"]


def test_the_drawing_points_where_the_agent_looks():
    for direction, way in zip((EAST, SOUTH, WEST, NORTH), [(1, 0), (0, -1), (-1, 0), (0, 1)], strict=True):
        game = at(ROOM, (1, 2), direction)
        middle = minigrid.maze_path(minigrid.maze_state(game, None))
        assert middle.tolist() == [1.5, 1.5]
        np.testing.assert_allclose(minigrid.maze_agent(game)[0].points[0] - middle, 0.35 * np.array(way), atol=1e-9)
    shown = minigrid.maze_shapes(game)
    assert len(shown) == 15
    goal = next(one for one in shown if one.colour == minigrid.GOAL_COLOUR)
    assert goal.points.mean(axis=0).tolist() == [3.5, 2.5]


@pytest.fixture(scope="module")
def config() -> EnvConfig:
    env: EnvConfig = composed("train", ["env=minigrid"]).env
    return env


@pytest.fixture(scope="module")
def four_rooms(config: EnvConfig) -> gymnasium.Env[Any, Any]:
    return make_env(config)


def test_who_does_as_told_arrives_on_the_shortest_way(four_rooms: gymnasium.Env[Any, Any]):
    task = task_of(four_rooms)
    for seed in range(10):
        state, _ = four_rooms.reset(seed=seed)
        left, success = int(state[minigrid.STEPS_TO_GOAL]), False
        for _ in range(left):
            assert not success
            state, _, terminated, _, info = four_rooms.step(ACTION[int(task.rule(state)[0])])
            success = info["success"]
        assert terminated
        assert success


def test_a_copy_counts_on_and_leaves_the_original_alone(four_rooms: gymnasium.Env[Any, Any]):
    state, _ = four_rooms.reset(seed=0)
    for _ in range(5):
        state, *_ = four_rooms.step(RIGHT)
    made: Any = stoppable(four_rooms)
    made.restore(made.snapshot())
    for _ in range(3):
        made.step(RIGHT)
        copied = minigrid.maze_state(made.game, None)
    after, *_ = four_rooms.step(LEFT)
    assert copied[minigrid.HEADING] == state[minigrid.HEADING] + 3
    assert after[minigrid.HEADING] == state[minigrid.HEADING] - 1


def test_the_trial_has_nothing_to_note(config: EnvConfig):
    assert try_out(config, simulated=True) == []
