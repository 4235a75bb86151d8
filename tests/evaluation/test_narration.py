"""What explain.py prints of one episode, on a lift that goes up, stays and comes down."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from by_hand import TASK, on_a_line, plain

from ibe_rl.config.settings import InstructorConfig, TrainConfig
from ibe_rl.evaluation import narration
from ibe_rl.evaluation.narration import clip_of, print_narration
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.explain.phrasing import ExplainerState, put_in_words
from ibe_rl.ibe import ClusterMapping, Meaning
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.task import RecordedRollout
from ibe_rl.types import CANNOT_TELL, ConfigError, Episode, Explanation, Moment

HEIGHTS = np.array([0, 1, 2, 3, 3, 3, 3, 2, 1, 0], float)
STEPS = len(HEIGHTS) - 1
SURE = Calibration(("agreement", "purity"), np.zeros(2), np.ones(2), np.zeros(2), np.array([2.0]))


def says(*expressions: float, **meaning: object) -> ClusterMapping:
    """What changes by -2, 0 and 2 are called."""
    where = np.column_stack([[-2, 0, 2], np.zeros((3, 2))])
    made = replace(on_a_line([0, 0, 0], expressions), space=plain(3), centres=where)
    return replace(made, meanings=(Meaning(**meaning),)) if meaning else made


def watched(heights: np.ndarray = HEIGHTS) -> RecordedRollout:
    states = np.column_stack([heights, np.zeros((len(heights), 2))])
    steps = len(heights) - 1
    instruction = np.ones((steps, 1))
    episode = Episode(states, np.zeros(steps), np.zeros(steps), instruction, np.ones(steps, bool), True, True, "lower")
    return RecordedRollout(
        episode, [Moment(states[t], instruction[t], True) for t in range(steps)], [], [[]] * (steps + 1)
    )


def explained(run: TrainedRun, rolled_out: RecordedRollout) -> list[Explanation]:
    """What is said if the next two steps are foreseen rightly."""
    states = rolled_out.episode.states
    ahead = np.minimum(np.arange(len(states) - 1)[:, None] + np.arange(3), len(states) - 1)
    return put_in_words(
        states[ahead][:, None], ExplainerState(run.mapping, 2, TASK.phrases, calibration=run.calibration)
    )


def run_of(mapping: ClusterMapping, folder: Path, calibration: Calibration | None = SURE) -> TrainedRun:
    return TrainedRun(
        folder, TrainConfig(instructor=InstructorConfig()), TASK, lambda seen: seen, 9, mapping, 9, 2, {}, calibration
    )


def printed(run: TrainedRun, rolled_out: RecordedRollout, said: list[Explanation] | None = None) -> list[str]:
    stream = io.StringIO()
    print_narration(
        run, rolled_out, said or explained(run, rolled_out), PlainConsole(file=stream, highlight=False, width=250)
    )
    return stream.getvalue().splitlines()


def test_it_begins_with_the_verdict_and_ends_with_both_figures(tmp_path: Path) -> None:
    lines = printed(run_of(says(-1, 0, 1), tmp_path), watched())
    found = "AUC of its words for the direction of motion: .97, good (chance .50, repeating the last instruction .50)."
    assert lines[0] == f"GOOD: {found}"  # where it rises by one it may say so or not
    assert found in lines[-1]
    assert lines[-1].startswith("100% of its explanations of the next 2 steps went as predicted; AUC of its words for ")
    assert any(line.split()[-2:] == ["as", "predicted"] for line in lines)


def test_reversed_words_are_not_praised(tmp_path: Path) -> None:
    """All of it goes as predicted, in its own words: that is why the other figure stands beside it."""
    lines = printed(run_of(says(1, 0, -1, reason="seen"), tmp_path), watched())
    assert lines[0].startswith("REVERSED: “going up” is said when height falls; ")
    assert lines[1].startswith("  what to do: env.task.explained=[height] says that height rises with +1, but ")
    assert lines[-1].startswith("100% of its explanations")
    assert ".03, reversed (chance .50" in lines[-1]


def test_of_an_episode_that_went_one_way_only_the_last_refresh_tells(tmp_path: Path) -> None:
    rolled_out = watched(np.arange(STEPS + 1.0))
    run = run_of(says(-1, 0, 1), tmp_path)
    lines = printed(run, rolled_out)
    assert lines[0] == "The AUC for the direction of motion cannot be measured in this episode."
    assert "cannot be measured (chance .50)" in lines[-1]
    scored = replace(run, scores_of_numbers=[{"motion_auc": 0.044, "echo_auc": 0.61}])
    text = "\n".join(printed(scored, rolled_out))
    assert (
        "REVERSED: “going up” is said when height falls; AUC of its words for the direction of motion: .04, reversed"
        in text
    )
    assert (
        "At the last refresh, over many episodes: AUC of its words for the direction of motion: .04, reversed" in text
    )


def test_a_wrong_sign_in_the_log_is_named_whatever_the_episode_says(tmp_path: Path) -> None:
    run = replace(
        run_of(says(-1, 0, 1, reason="seen"), tmp_path), scores_of_numbers=[{"motion_auc": 0.1, "echo_auc": 0.6}]
    )
    lines = printed(run, watched())
    assert lines[0].startswith("GOOD: ")
    assert any(line.startswith("env.task.explained=[height] says that height rises with +1, but") for line in lines)


def test_words_without_a_known_meaning_are_not_said(tmp_path: Path) -> None:
    lines = printed(run_of(says(-1, 0, 1, positive=False, reason="nobody did it"), tmp_path), watched())
    assert "“going down”: +1 asks for a movement, nobody did it, but I cannot tell what “going up” means" in lines
    [row] = [line.split() for line in lines if CANNOT_TELL in line and line.split()[0].startswith("0")]
    assert row[-3:] == ["-", "-", "-"]  # expression, confidence, as predicted
    assert "% of its explanations (at 78% of the moments) of the next" in lines[-1]
    rows = [line for line in lines if re.match(r" *\d+(-\d+)?  ", line)]
    assert {line.count("up") for line in rows} == {1}  # that is what it was told


def test_of_nothing_said_no_share_is_reported(tmp_path: Path) -> None:
    unknown = says(-1, 0, 1, negative=False, positive=False, reason="nobody did it")
    lines = printed(run_of(unknown, tmp_path), watched())
    assert lines[0] == "UNKNOWN: I cannot tell what “going up” means: nobody did it."
    assert sum("nobody did it" in line for line in lines) == 1
    assert lines[-1].startswith(
        "It gave no explanation; AUC of its words for the direction of motion: the meaning of its words is not "
    )


@pytest.mark.parametrize("calibration", [SURE, None])
def test_how_sure_it_is_stands_only_where_that_is_a_probability(
    tmp_path: Path, calibration: Calibration | None
) -> None:
    lines = printed(run_of(says(-1, 0, 1), tmp_path, calibration), watched())
    row = next(line.split() for line in lines if line.lstrip().startswith("0-"))
    assert row[-2] == ("88%" if calibration else "-")


def test_a_change_of_words_that_is_undone_at_once_has_no_row(tmp_path: Path) -> None:
    run, rolled_out = run_of(says(-1, 0, 1), tmp_path), watched(np.zeros(40))
    said = explained(run, rolled_out)
    said[20] = replace(said[20], phrase="going up")
    lines = printed(run, rolled_out, said)
    assert len([line for line in lines if re.match(r" *\d+(-\d+)?  ", line)]) == 1
    left_out = "Left out: phrases that change for at most 5 steps and back (1 of 39 steps). "
    assert f"{left_out}viewer=live or viewer=file shows every step." in [line.strip() for line in lines]


def test_the_table_is_never_longer_than_a_screen_and_says_what_it_leaves_out(tmp_path: Path) -> None:
    run, rolled_out = run_of(says(-1, 0, 1), tmp_path), watched(np.zeros(1 + 7 * 60))
    said = [
        replace(one, phrase=("going up", "staying", "going down")[step // 7 % 3])
        for step, one in enumerate(explained(run, rolled_out))
    ]
    lines = [line.strip() for line in printed(run, rolled_out, said)]
    rows = [line for line in lines if re.match(r"\d+-\d+  ", line)]
    assert len(rows) == 40
    assert rows[29].startswith("203-209")
    assert rows[30].startswith("350-356")
    assert lines[lines.index("...") - 1] == rows[29]
    assert "Left out: 20 rows in the middle. viewer=live or viewer=file shows every step." in lines


def test_a_clip_that_cannot_be_finished_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(narration, "write_clip", full)
    made = SimpleNamespace(metadata={})
    run: Any = SimpleNamespace(horizon_steps=2, mapping=says(-1, 0, 1), task=TASK, make_env=lambda: made)
    with pytest.raises(ConfigError, match=r"clip=.*x.gif: allowed is a file that can be written \(No space left"):
        clip_of(run, watched(), [], tmp_path / "x.gif")
