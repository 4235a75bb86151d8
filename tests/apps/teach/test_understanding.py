"""What the pages are told of what the agent has understood, and the lesson in sum."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from by_hand import STEPS, TASK, WORDS, add, config

from ibe_rl.apps.teach.summary_page import write_lesson_page
from ibe_rl.apps.teach.understanding import consistency, heard_windows, lesson_summary, not_yet, understanding_line
from ibe_rl.ibe.delay import Delay
from ibe_rl.ibe.meaning import Meaning
from ibe_rl.instructors.taught import told_of
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task.words import Words
from ibe_rl.types import Episode
from ibe_rl.vocabulary.fitting import learn_vocabulary
from ibe_rl.vocabulary.refresh import Refresh
from ibe_rl.vocabulary.words import MEANS_NOTHING, MEANS_SAME, WordNotice

PERSON = np.tile(np.array(told_of("person"), np.int32), (STEPS, 1))


@pytest.fixture
def log(tmp_path: Path) -> TrajectoryLog:
    made = TrajectoryLog(tmp_path / "log", 10_000, TASK.contexts)
    for _ in range(30):
        for instruction in (1.0, -1.0, 0.0):
            add(made, 1.0, instruction, told=PERSON)
    return made


def learnt(log: TrajectoryLog, *meanings: Meaning, **counts: int) -> Refresh:
    refresh = learn_vocabulary(log, config(kind="paper"), TASK, seed=0)
    heard = {"-1": 200, "0": 200, "+1": 200} | {name.replace("plus", "+"): count for name, count in counts.items()}
    mapping = replace(refresh.mapping, meanings=meanings)
    return replace(refresh, mapping=mapping, windows_by_instruction=heard, delays={})


def test_what_it_has_understood_and_what_it_lacks(log: TrajectoryLog):
    assert not_yet(34, 100) == "I look for what your words mean once I have seen 100 episodes; so far 34."
    all_known = learnt(log, Meaning())
    assert understanding_line(all_known, TASK) == "I understand '-1', '0' and '+1'."
    rare = learnt(log, Meaning(positive=False), plus1=3)
    assert understanding_line(rare, TASK) == "I understand '-1' and '0'. I have not heard '+1' in good episodes yet."
    unclear = learnt(log, Meaning(positive=False))
    assert understanding_line(unclear, TASK).endswith("I have heard '+1', but cannot tell what that means.")
    nothing = learnt(log, Meaning(negative=False, positive=False))
    assert understanding_line(nothing, TASK) == "I do not understand your words yet."


def test_a_word_that_was_renamed_since_is_the_same_word(log: TrajectoryLog):
    worded = replace(TASK, phrases=Words(["left", "hold", "right"], 4))
    refresh = replace(learnt(log), windows_by_instruction={"left": 200, "hold": 3, "right": 200})
    unknown, k = Meaning(negative=False, positive=False), len(refresh.mapping.ids)
    meanings = (Meaning(), unknown, Meaning(), unknown)
    refresh = replace(refresh, mapping=replace(refresh.mapping, expressions=np.zeros((k, 4)), meanings=meanings))
    assert worded.words is not None
    worded.words.rename(0, "links")
    worded.words.add("faster")
    assert heard_windows(refresh, worded) == {"links": 200, "hold": 3, "right": 200, "faster": 0}
    lacks = "I have not heard 'hold' or 'faster' in good episodes yet."
    assert understanding_line(refresh, worded) == f"I understand 'links' and 'right'. {lacks}"


def test_it_says_how_late_the_person_is(log: TrajectoryLog):
    late = replace(learnt(log, Meaning()), delays={"person": Delay(22, 18, 25)})
    assert (
        understanding_line(late, TASK) == "I understand '-1', '0' and '+1'. You are about 22 steps behind (18 to 25)."
    )
    assert "behind" not in understanding_line(replace(late, delays={"instructor": Delay(22, 18, 25)}), TASK)


def test_it_says_what_it_notices_about_the_words_but_not_twice(log: TrajectoryLog):
    alike = WordNotice(MEANS_SAME, (0, 1), "you use 'left' and 'west' alike")
    noticed = replace(
        learnt(log, Meaning()), word_notices=[alike, WordNotice(MEANS_NOTHING, (2,), "'up' means nothing yet")]
    )
    assert understanding_line(noticed, TASK) == "I understand '-1', '0' and '+1'. You use 'left' and 'west' alike."


def says(value: float, steps: int = 200, random: bool = False) -> Episode:
    """Up when it is high, or at random."""
    chance = np.random.default_rng(int(value * 10) + steps)
    states = chance.uniform(-1, 1, (steps + 1, 1)).astype(np.float32)
    said = chance.choice([-1.0, 1.0], (steps, 1)) if random else np.sign(states[:-1]) * value
    return Episode(states, np.zeros(steps), np.zeros(steps), said, np.ones(steps, bool), True, True, "lower")


def test_how_consistent_a_person_is():
    assert consistency([]) is consistency([says(1.0)]) is consistency([says(1.0, 20), says(1.0, 20)]) is None
    steady, random = consistency([says(1.0), says(1.0)]), consistency([says(1.0, random=True), says(0.5, random=True)])
    assert steady is not None
    assert random is not None
    assert steady > 0.95
    assert 0.35 < random < 0.65


def test_the_lesson_in_sum(log: TrajectoryLog, tmp_path: Path):
    summary = lesson_summary(log, TASK, learnt(log, Meaning()))
    assert (summary["episodes"], summary["marked"]) == (60, 0)
    assert [one["said_steps"] for one in summary["words"]] == [20 * STEPS] * 3
    assert [one["in_good_episodes"] for one in summary["words"]] == [200] * 3
    assert [one["word"] for one in summary["words"]] == [WORDS.negative.format(degree=""), WORDS.zero, "going up"]
    assert summary["understood"].startswith("I understand")
    empty = lesson_summary(log, TASK, None)
    assert (empty["understood"], empty["meaning"]) == ("I have not learnt a vocabulary.", [])
    films = [{"said": "</script><b>", "pictures": []}]
    page = write_lesson_page(tmp_path, {**json.loads(json.dumps(summary)), "films": films}).read_text()
    assert page.count("</script>") == 1
    assert "\\u003c/script>" in page
    assert "showSummary({" in page
