"""Did it come true? What the agent said of the taught episode, compared with what came; and short films of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ibe_rl.explain.phrasing import ExplainerState
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.task import Task
from ibe_rl.types import Array, Explanation

PICTURE_EVERY_STEPS, MOST_PICTURES, MOST_FILMS = 3, 40, 8


@dataclass(frozen=True)
class _Said:
    """An explanation that has still to come true, and the vocabulary it was made with."""

    step: int
    state: Array
    said: Explanation
    explainer: ExplainerState


class Outcomes:
    """What became of the explanations of the taught episodes.

    Args:
        task: of the environment.

    Attributes:
        films: by phrase, the newest one that came true, or one that did not while there is no other.
    """

    def __init__(self, task: Task):
        self._task, self._episode, self._scene = task, -1, dict[str, Any]()
        self._open: list[_Said] = []
        self._pictures: deque[tuple[int, Any]] = deque(maxlen=MOST_PICTURES)
        self.films: dict[str, dict[str, Any]] = {}

    def begin(self, scene: Mapping[str, Any]) -> None:
        """Begin an episode; what was said of the one before and is still open is dropped."""
        self._episode, self._scene, self._open = scene["episode"], dict(scene), []
        self._pictures.clear()

    def hear(self, episode: int, step: int, state: Array, said: Explanation, explainer: ExplainerState) -> None:
        """Remember an explanation of the state at a step; any thread may call this."""
        if episode == self._episode and said.known:
            self._open.append(_Said(step, state, said, explainer))

    def step(self, step: int, state: Array, shapes: Any) -> dict[str, Any] | None:
        """Take the next state ``(S,)``; returns the outcome of an explanation that is due, as a page shows it."""
        if step % PICTURE_EVERY_STEPS == 0:
            self._pictures.append((step, shapes))
        due = [one for one in self._open if step >= one.step + one.said.horizon_steps]
        if not due:
            return None
        self._open = [one for one in self._open if one not in due]
        return self._outcome(due[-1], step, state)

    def _outcome(self, about: _Said, step: int, state: Array) -> dict[str, Any]:
        expression = about.explainer.mapping.express((state - about.state)[None])
        went = str(phrases_of(expression, about.explainer.words)[0])
        outcome = {"episode": self._episode, "step": about.step, "said": about.said.phrase, "went": went}
        outcome["came_true"] = went == about.said.phrase
        self._film(outcome, step)
        return outcome

    def _film(self, outcome: dict[str, Any], until: int) -> None:
        said = outcome["said"]
        pictures = [shapes for step, shapes in self._pictures if outcome["step"] <= step <= until]
        known = self.films.get(said)
        better = known is None or outcome["came_true"] or not known["came_true"]
        if pictures and better and (said in self.films or len(self.films) < MOST_FILMS):
            about = {name: self._scene[name] for name in ("size", "background")}
            self.films[said] = {**outcome, **about, "pictures": pictures}
