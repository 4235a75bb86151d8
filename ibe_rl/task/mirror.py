"""A symmetry of an environment: its mirror image, which obeys the same dynamics, rewards and rule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(frozen=True)
class SignedPermutation:
    """Numbers that change places and signs and are back after two times.

    Attributes:
        order: for each number the index of the one that takes its place.
        signs: for each number, 1 or -1, by which that one is multiplied.

    Raises:
        ValueError: if applying it twice would not give the same numbers.
    """

    order: tuple[int, ...]
    signs: tuple[float, ...]

    def __post_init__(self) -> None:
        numbers = np.arange(1.0, len(self.order) + 1)
        known = sorted(self.order) == list(range(len(self.order))) and len(self.signs) == len(self.order)
        if not known or {*self.signs} - {-1.0, 1.0} or not np.array_equal(self(self(numbers)), numbers):
            raise ValueError(f"order {self.order} with signs {self.signs}: allowed is what twice changes nothing")

    @classmethod
    def of_signs(cls, signs: Sequence[float]) -> Self:
        """Numbers that keep their places."""
        return cls(tuple(range(len(signs))), tuple(signs))

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        """Rows ``(..., N)`` to rows."""
        return rows[..., list(self.order)] * np.array(self.signs, rows.dtype)

    def followed_by(self, further: SignedPermutation) -> SignedPermutation:
        """The same for ``further`` numbers behind these."""
        begin = len(self.order)
        return SignedPermutation(
            (*self.order, *(begin + place for place in further.order)), (*self.signs, *further.signs)
        )


@dataclass(frozen=True)
class Mirror:
    """A mirror image: whatever happens in the environment happens as well with left and right exchanged.

    Attributes:
        flipped: names of the state dimensions that change sign.
        swapped: pairs of names of state dimensions that change places.
        instruction: 1 or -1 for each number of an instruction.
        actions: discrete actions: for each, counted from 0, the one that does the same in the mirror image.
        action_signs: continuous actions: 1 or -1 for each number.
    """

    flipped: tuple[str, ...]
    swapped: tuple[tuple[str, str], ...] = ()
    instruction: tuple[float, ...] = (-1.0,)
    actions: tuple[int, ...] = ()
    action_signs: tuple[float, ...] = ()

    def of_states(self, names: Sequence[str]) -> SignedPermutation:
        """Of states with these ``names``.

        Raises:
            ValueError: for a name that is not among them.
        """
        partner = {name: name for name in names}
        for one, other in self.swapped:
            partner[one], partner[other] = other, one
        if unknown := sorted({*self.flipped, *partner} - {*names}):
            raise ValueError(f"{', '.join(unknown)}: allowed are {', '.join(names)}")
        signs = tuple(-1.0 if name in self.flipped else 1.0 for name in names)
        return SignedPermutation(tuple(list(names).index(partner[name]) for name in names), signs)

    def check(self, names: Sequence[str], instruction_size: int) -> None:
        """Check it for states with these ``names``, and instructions of so many numbers.

        Raises:
            ValueError: naming what does not fit.
        """
        try:
            self.of_states(names)
            self.of_actions()
        except ValueError as error:
            raise ValueError(f"Task.mirror: {error}") from None
        if len(self.instruction) != instruction_size:
            raise ValueError(f"Task.mirror.instruction={self.instruction}: allowed are {instruction_size} signs")

    def of_observations(self, names: Sequence[str]) -> SignedPermutation:
        """Of observations: state, instruction, and whether it was given."""
        return self.of_states(names).followed_by(SignedPermutation.of_signs((*self.instruction, 1.0)))

    def of_actions(self) -> SignedPermutation:
        """Of the values of discrete actions, or of the numbers of a continuous one."""
        if self.actions:
            return SignedPermutation(self.actions, (1.0,) * len(self.actions))
        return SignedPermutation.of_signs(self.action_signs)
