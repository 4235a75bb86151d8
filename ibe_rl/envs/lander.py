"""gymnasium's Lunar Lander with the pad at left, centre or right: the paper's environment.

Physics, step and terrain draws are gymnasium's. Four things are new: the flat part of the terrain lies under the pad,
the goal is part of the state, the shaped reward uses the distance to it, and ``snapshot`` and ``restore``, also from
one copy to another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.envs.box2d import lunar_lander as game
from gymnasium.utils import EzPickle

from ibe_rl.envs.lander_speed_task import LANDER_SPEED_TASK
from ibe_rl.envs.lander_task import FLAG_DISTANCE, HEIGHT, LANDER_TASK, PAD_X, PAD_Y, WIDTH, outline
from ibe_rl.envs.lander_words_task import LANDER_WORDS_TASK
from ibe_rl.envs.lean_step import lean_step
from ibe_rl.task import Shape
from ibe_rl.task.mirror import Mirror
from ibe_rl.types import Array

CHUNKS = 11  # vertices of gymnasium's terrain, 0.2 half widths apart
PAD_STREAM = 0x1BE  # separates pad draws from gymnasium's with the same seed


@dataclass(frozen=True)
class LanderSnapshot:
    """All that ``step`` reads.

    Attributes:
        bodies: ``(3, 6)`` x, y, angle and their velocities of the lander and its two legs (m, rad, s).
        awake: ``(3,)`` Box2D's flag that a body is not at rest.
        contacts: ``(2,)`` ground contact of each leg.
        game_over: True once the body has touched the ground.
        terrain: ``(11,)`` heights in metres.
        pad: name of the pad.
        shaping: gymnasium's potential, and the correction of its distance term.
        wind: the two indices of gymnasium's wind, zeros without wind.
        generator: state of the random generator of the engines' noise.
    """

    bodies: Array
    awake: tuple[bool, ...]
    contacts: tuple[bool, ...]
    game_over: bool
    terrain: Array
    pad: str
    shaping: tuple[float, float]
    wind: tuple[int, int]
    generator: dict[str, Any]


class LunarLanderPads(game.LunarLander):
    """Land on the pad.

    The state has nine numbers: gymnasium's eight and the pad's x. The reward is gymnasium's with the
    distance measured to the pad. ``info["landed"]`` is True if the lander rests at the end, with both legs in
    contact and its centre between the flags. ``reset(options={"pad": "left"})`` places the pad for one episode.

    Args:
        pad: "random" to draw the pad for each episode, or "left", "center", "right".
        flat: flat ground everywhere (the paper's prediction task).
        flags: False hides the flags in ``render`` (the paper's prediction task).
        speed: True also instructs how fast to fall (``lander_speed_task``).
        words: True instructs by one of five words without an order instead (``lander_words_task``).
        **kwargs: gymnasium's own, such as ``render_mode``.

    Attributes:
        lean: whether ``step`` uses ``lean_step``; False: gymnasium's own step, which gives the same numbers.

    Raises:
        ValueError: for an unknown pad.
    """

    new_observations = True  # each step makes its own
    lander: Any
    prev_shaping: Any
    wind_idx: Any
    torque_idx: Any

    def __init__(
        self,
        pad: str = "random",
        flat: bool = False,
        flags: bool = True,
        speed: bool = False,
        words: bool = False,
        **kwargs: Any,
    ):
        super().__init__(**kwargs)
        EzPickle.__init__(self, pad, flat, flags, speed, words, **kwargs)  # a copy is made with our arguments
        task = LANDER_WORDS_TASK if words else LANDER_SPEED_TASK if speed else LANDER_TASK
        mirror = self._mirror(task.mirror)
        self.task = task if mirror == task.mirror else replace(task, mirror=mirror)
        self._default_pad = self._checked(pad, ("random", *PAD_X))
        self._flat, self._flags = flat, flags
        self.lean = not (self.enable_wind or self.render_mode)
        self.pad = "center"
        self._pad_random = np.random.default_rng()
        theirs: Any = self.observation_space
        self.observation_space = spaces.Box(
            np.append(theirs.low, np.float32(-1)), np.append(theirs.high, np.float32(1))
        )

    def _mirror(self, declared: Mirror | None) -> Mirror | None:
        """The mirror image with these actions; None with wind, which has none."""
        if declared is None or self.enable_wind:
            return None
        return replace(declared, actions=(), action_signs=(1.0, -1.0)) if self.continuous else declared

    @staticmethod
    def _checked(pad: str, allowed: Sequence[str]) -> str:
        if pad not in allowed:
            raise ValueError(f"pad={pad!r}: choose one of {', '.join(allowed)}")
        return pad

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; ``options={"pad": ...}`` overrides the pad for this one."""
        if seed is not None:
            self._pad_random = np.random.default_rng([PAD_STREAM, seed])
        drawn = list(PAD_X)[self._pad_random.integers(len(PAD_X))]  # drawn even if unused, so later draws do not shift
        asked = self._checked((options or {}).get("pad", self._default_pad), ("random", *PAD_X))
        self.pad = drawn if asked == "random" else asked
        self._gap = 0.0
        observation, _ = super().reset(seed=seed)
        self.terrain = np.array([polygon[0][1] for polygon in self.sky_polys] + [self.sky_polys[-1][1][1]])
        self._lay_terrain(self._moved_terrain())
        return observation, {"landed": False}

    def _moved_terrain(self) -> Array:
        """Terrain shifted so that its flat part lies under the pad."""
        if self._flat:
            return np.full(CHUNKS, self.terrain[CHUNKS // 2])
        return np.roll(self.terrain, round(PAD_X[self.pad] * (CHUNKS // 2)))

    def _lay_terrain(self, heights: Array) -> None:
        """Build ground of heights ``(11,)`` in metres, and place the flags beside the pad."""
        middle = WIDTH / 2 * (1 + PAD_X[self.pad])
        self.helipad_x1, self.helipad_x2 = (middle + side * FLAG_DISTANCE * WIDTH / 2 for side in (-1, 1))
        if np.array_equal(heights, self.terrain):
            return  # with the pad in the centre the world stays exactly gymnasium's
        self.terrain = heights
        self.world.DestroyBody(self.moon)
        moon: Any = self.world.CreateStaticBody(shapes=game.edgeShape(vertices=[(0, 0), (WIDTH, 0)]))
        self.moon = moon
        self.sky_polys = []
        for left, right in pairwise(self._corners()):
            moon.CreateEdgeFixture(vertices=[left, right], density=0, friction=0.1)
            self.sky_polys.append([left, right, (right[0], HEIGHT), (left[0], HEIGHT)])

    def _corners(self) -> list[tuple[float, float]]:
        return list(zip(np.linspace(0, WIDTH, CHUNKS).tolist(), self.terrain.tolist(), strict=True))

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Step gymnasium's lander, then correct the reward for the distance to the pad instead of the centre."""
        if self.lean:
            state, reward, terminated = lean_step(self, action)
        else:
            state, reward, terminated, _, _ = super().step(action)
        goal = PAD_X[self.pad]
        extended = np.array([*state, goal], np.float32)
        x, y = extended[:2].tolist()
        gap = math.hypot(x - goal, y) - math.hypot(x, y)
        if not terminated:  # the terminal reward is exactly +100 or -100
            reward -= 100 * (gap - self._gap)
        self._gap = gap
        return extended, float(reward), terminated, False, {"landed": terminated and self._landed(x - goal)}

    def _landed(self, offset: float) -> bool:
        both_legs = all(leg.ground_contact for leg in self.legs)
        return not self.lander.awake and both_legs and abs(offset) <= FLAG_DISTANCE

    def render(self) -> Any:
        """Render as gymnasium does, without the flags if they are hidden."""
        shown = self.helipad_x1, self.helipad_x2
        if not self._flags:
            self.helipad_x1 = self.helipad_x2 = -WIDTH  # outside the picture
        try:
            return super().render()
        finally:
            self.helipad_x1, self.helipad_x2 = shown

    def snapshot(self) -> LanderSnapshot:
        """Copy all that ``step`` reads, without the time limit."""
        bodies = [self.lander, *self.legs]
        return LanderSnapshot(
            bodies=np.array([[*b.position, b.angle, *b.linearVelocity, b.angularVelocity] for b in bodies]),
            awake=tuple(body.awake for body in bodies),
            contacts=tuple(leg.ground_contact for leg in self.legs),
            game_over=self.game_over,
            terrain=self.terrain,
            pad=self.pad,
            shaping=(float(self.prev_shaping), self._gap),
            wind=(self.wind_idx, self.torque_idx) if self.enable_wind else (0, 0),
            generator=dict(self.np_random.bit_generator.state),
        )

    def restore(self, snapshot: LanderSnapshot, noise: np.random.Generator | None = None) -> None:
        """Continue from ``snapshot``, also of another copy; call ``reset`` once before.

        Box2D's visible body state is restored bit for bit. The impulses in contacts and joints and the time at rest
        are hidden, so a continuation can differ. Errors over 60 steps, in observation units: 6e-7 (median; 95th
        percentile 1e-5) from the air, also with a touchdown; 1e-5 (median; 0.2) from the ground. Rest can be detected
        up to 25 steps later.

        Args:
            snapshot: from ``snapshot()``.
            noise: generator of the engines' noise from here on; None repeats the original's draws.
        """
        self.pad = snapshot.pad
        self._lay_terrain(snapshot.terrain)
        for body in (self.lander, *self.legs):
            body.active = body.awake = False  # clears the previous episode's contacts and time at rest
            body.active = body.awake = True
        self._place(snapshot)
        self.world.Step(1 / game.FPS, 6 * 30, 2 * 30)  # warms up Box2D's hidden impulses
        self._place(snapshot)
        for leg, contact in zip(self.legs, snapshot.contacts, strict=True):  # a touching leg may not count
            leg.ground_contact = contact and any(edge.contact.touching for edge in leg.contacts)
        self.game_over = snapshot.game_over
        self.prev_shaping, self._gap = snapshot.shaping
        self.wind_idx, self.torque_idx = snapshot.wind
        if noise is None:
            noise = np.random.Generator(np.random.PCG64())
            noise.bit_generator.state = snapshot.generator
        self.np_random = noise

    def _place(self, snapshot: LanderSnapshot) -> None:
        for body, row, awake in zip([self.lander, *self.legs], snapshot.bodies, snapshot.awake, strict=True):
            body.transform = (row[:2], row[2])
            body.linearVelocity, body.angularVelocity = row[3:5], row[5]
            body.awake = awake

    def background(self) -> list[Shape]:
        """The ground, and the flags unless they are hidden, in metres."""
        ground = Shape(np.array(self._corners()), (150, 150, 160))
        flags = [
            Shape(np.array([(x, PAD_Y), (x, PAD_Y + 1.6), (x + 0.7, PAD_Y + 1.4), (x, PAD_Y + 1.2)]), (250, 204, 21))
            for x in (self.helipad_x1, self.helipad_x2)
        ]
        return [ground, *(flags if self._flags else [])]

    def figure(self) -> list[Shape]:
        """Current outlines of the lander and its legs, in metres."""
        return [Shape(outline(body), (165, 148, 249), closed=True) for body in (self.lander, *self.legs)]
