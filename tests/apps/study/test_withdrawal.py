"""Who asks for it later is deleted, also while the study is served."""

from __future__ import annotations

from pathlib import Path

import pytest
from own_study import write_study

from ibe_rl.apps.study.answers import FILE, Answer, Answers
from ibe_rl.apps.study.withdrawal import withdraw_participant
from ibe_rl.types import ConfigError


def test_answers_and_id_are_gone(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    with pytest.raises(ConfigError, match="nobody has taken part yet"):
        withdraw_participant(folder, "c1")
    served = Answers(folder / FILE)
    people = [served.begin(("ibe",), "hash", False, "codes", code) for code in ("c1", "c2")]
    for person in people:
        served.keep(person, Answer("comment", 1, {"text": "mine"}, 1, 0))
    assert withdraw_participant(folder, "c1").startswith("participant 1: deleted")
    assert [one.ended for one in served.people()] == ["withdrawn", None]
    assert [len(served.answers_of(person)) for person in people] == [0, 1]
    with pytest.raises(ConfigError, match="participant=c1: nobody with this ID takes part; allowed is one of codes"):
        withdraw_participant(folder, "c1")
    assert withdraw_participant(folder, people[1].token).startswith("participant 2: deleted")  # by a link to a bundle
    served.close()
