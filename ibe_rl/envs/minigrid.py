"""The task of MiniGrid's mazes: told to turn left, go ahead or turn right, as the shortest way to the goal does.

The extra ``environments`` brings MiniGrid. Any maze fits that has a goal, and walls that stand still: Empty, FourRooms,
SimpleCrossing, LavaCrossing. Headings are in quarter turns to the right, counted on over an episode.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ibe_rl.task import Shape
from ibe_rl.types import Array

HEADING, WAY, STEPS_TO_GOAL = 2, 3, 4
NEAR_GOAL_STEPS = 12
"""A goal within so many steps is near."""
AHEAD = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""One step in each of MiniGrid's four directions; its y points down."""
WALL_COLOUR, GOAL_COLOUR, AGENT_COLOUR = (100, 116, 139), (74, 222, 128), (248, 113, 113)
SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
ARROW = np.array([(0.35, 0.0), (-0.3, 0.3), (-0.3, -0.3)])


@dataclass
class Walk:
    """What an episode needs beyond a moment; kept at the environment, so that copies of it have their own.

    Attributes:
        grid: the maze, of this episode only.
        steps: ``(width, height, 4)`` to the goal from each cell and direction, -1 where no way leads there.
        heading: of the last observation.
    """

    grid: Any
    steps: Array
    heading: int


def maze_state(env: Any, observation: Any) -> Array:
    """The state: ``x`` and ``y`` up in cells, heading, heading of the shortest way, steps to the goal, -1 in lava.

    Args:
        env: the maze, at which a ``Walk`` is kept.
        observation: its view, not read.

    Raises:
        ValueError: if no way leads to a goal.
    """
    del observation
    (x, y), direction = env.agent_pos, int(env.agent_dir)
    walk = getattr(env, "ibe_rl_walk", None)
    if walk is None or walk.grid is not env.grid:  # MiniGrid makes a new one at each reset
        walk = env.ibe_rl_walk = Walk(env.grid, steps_to_goal(env.grid), direction)
    walk.heading += (direction - walk.heading + 1) % 4 - 1
    left, cell = walk.steps[x, y, direction], env.grid.get(x, y)
    if left < 0 and not (cell is not None and cell.type == "lava"):  # where an episode ends
        raise ValueError("no way leads to a goal; mazes with doors or moving obstacles need a rule of their own")
    way = walk.heading + _turn(walk.steps, x, y, direction)
    return np.array([x, env.height - 1 - y, walk.heading, way, left], np.float32)


def _turn(steps: Array, x: int, y: int, direction: int) -> int:
    """-1, 0 or 1: the next turn of a shortest way; ahead rather than a turn, right rather than left."""
    here, (right, down) = steps[x, y, direction], AHEAD[direction]
    if here <= 0 or steps[x + right, y + down, direction] == here - 1:
        return 0
    return 1 if steps[x, y, (direction + 1) % 4] == here - 1 else -1


def steps_to_goal(grid: Any) -> Array:
    """Least number of turns and steps ``(width, height, 4)`` to a goal, from each cell and direction; -1: no way."""
    steps = np.full((grid.width, grid.height, 4), -1)
    cells = {(x, y): grid.get(x, y) for x in range(grid.width) for y in range(grid.height)}
    free = {place for place, cell in cells.items() if cell is None or (cell.can_overlap() and cell.type != "lava")}
    waiting = [(*place, way) for place in free if cells[place] and cells[place].type == "goal" for way in range(4)]
    for place in waiting:
        steps[place] = 0
    for x, y, way in waiting:  # grows while it is read: breadth first, backwards
        behind = (x - AHEAD[way][0], y - AHEAD[way][1], way)
        for before in (behind, (x, y, (way + 1) % 4), (x, y, (way - 1) % 4)):
            if before[:2] in free and steps[before] < 0:
                steps[before] = steps[x, y, way] + 1
                waiting.append(before)
    return steps


def maze_instruction(states: Array) -> Array:
    """States ``(..., 5)`` to ``(..., 1)`` float32: -1 turn left, 0 go ahead, +1 turn right."""
    return np.sign(states[..., WAY, None] - states[..., HEADING, None]).astype(np.float32)


def at_goal(state: Array, terminated: bool, truncated: bool) -> bool:
    """Whether the episode ended at the goal."""
    del truncated
    return terminated and bool(state[STEPS_TO_GOAL] == 0)


def maze_distance(state: Array) -> str:
    """Whether the goal is near or far from ``state`` ``(5,)``."""
    return "near" if state[STEPS_TO_GOAL] <= NEAR_GOAL_STEPS else "far"


def maze_path(states: Array) -> Array:
    """States ``(..., 5)`` to the middle of the agent's cell ``(..., 2)``."""
    return states[..., :2] + 0.5


def maze_shapes(env: Any) -> list[Shape]:
    """Walls and goal."""
    places = [(x, y, env.grid.get(x, y)) for x in range(env.width) for y in range(env.height)]
    shown = [(x, env.height - 1 - y, cell.type) for x, y, cell in places if cell is not None]
    return [
        Shape(SQUARE + np.array([x, y]), GOAL_COLOUR if kind == "goal" else WALL_COLOUR, closed=True)
        for x, y, kind in shown
    ]


def maze_agent(env: Any) -> list[Shape]:
    """The agent, as an arrow."""
    (x, y), (right, down) = env.agent_pos, AHEAD[int(env.agent_dir)]
    turned = ARROW @ np.array([(right, -down), (down, right)])
    return [Shape(turned + np.array([x + 0.5, env.height - 0.5 - y]), AGENT_COLOUR, closed=True)]
