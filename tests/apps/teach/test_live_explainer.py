"""What the agent says live is what ``explain`` says, with the newest weights and the newest vocabulary."""

from __future__ import annotations

import json
import threading
from dataclasses import replace

import numpy as np
import pytest
from on_stage import HORIZON_STEPS, explainer_state, greedy, make_lander, speaks

from ibe_rl.apps.teach.live_explainer import explanation_fields, weights_of, what_if_fields
from ibe_rl.envs import LANDER_TASK
from ibe_rl.explain.explainer import explain
from ibe_rl.explain.phrasing import CONFIDENCE_FEATURES, Asking
from ibe_rl.explain.what_if import values_of
from ibe_rl.ibe import ClusterMapping, Meaning
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.predict.simulator import Simulator
from ibe_rl.types import CANNOT_TELL, Explanation, Moment

OBSERVATIONS = np.random.default_rng(0).normal(size=(200, LANDER_TASK.observation_size)).astype(np.float32)

WITHOUT_SCENE = replace(LANDER_TASK, scene_path=None)


@pytest.fixture(scope="module")
def moment() -> Moment:
    game = make_lander()
    state, _ = game.reset(seed=1)
    return Moment(state, np.array([1.0], np.float32), True, game.unwrapped.snapshot())


def test_it_is_silent_before_there_is_a_vocabulary():
    speaker, policy = speaks()
    assert not speaker.due()
    speaker.learn(weights_of(policy))
    assert not speaker.due()
    speaker.speak_with(explainer_state())
    assert speaker.due()


def test_it_speaks_no_more_often_than_it_may(moment: Moment):
    now = [50.0]
    speaker, _ = speaks(every_s=0.5, clock=lambda: now[0])
    speaker.speak_with(explainer_state())
    spoken = []
    for _ in range(40):
        if speaker.due():
            speaker.say(moment)
            spoken.append(now[0])
        now[0] += 0.125
    assert np.diff(spoken).tolist() == [0.5] * 9
    assert spoken[0] == 50.0


def test_a_slow_prediction_does_not_make_it_speak_all_the_time(moment: Moment):
    """The pause begins when it has spoken."""
    now = [0.0]

    def clock() -> float:
        now[0] += 0.4
        return now[0]

    speaker, _ = speaks(every_s=1.0, clock=clock)
    speaker.speak_with(explainer_state())
    assert speaker.due()
    speaker.say(moment)
    assert [speaker.due() for _ in range(3)] == [False, False, True]


def test_what_it_is_asked_for_is_said_in_a_thread_of_its_own(moment: Moment):
    speaker, _ = speaks(every_s=0.0)
    speaker.speak_with(explainer_state())
    may_go, heard = threading.Event(), list[str]()

    def hear(said: Explanation) -> None:
        may_go.wait()
        heard.append(said.said + " in " + threading.current_thread().name)

    speaker.ask(moment, hear)
    assert not speaker.due()  # it is still at it
    may_go.set()
    speaker.wait()
    assert heard == [f"{speaker.say(moment).said} in speaker_0"]
    assert speaker.due()


def test_what_goes_wrong_while_it_speaks_is_not_hidden(moment: Moment):
    speaker, _ = speaks(every_s=0.0)
    speaker.speak_with(explainer_state())
    speaker.ask(replace(moment, snapshot=None), lambda _: None)
    with pytest.raises(AttributeError):
        speaker.wait()
    with pytest.raises(AttributeError):
        speaker.due()


def test_it_says_what_explain_says(moment: Moment):
    speaker, policy = speaks()
    speaker.speak_with(explainer_state())
    said = speaker.say(moment)
    [expected] = explain([moment], policy, Simulator(make_lander, LANDER_TASK.rule, seed=5), explainer_state())
    assert (said.phrase, said.cluster, said.confidence) == (expected.phrase, expected.cluster, expected.confidence)
    np.testing.assert_array_equal(said.expression, expected.expression)
    np.testing.assert_array_equal(said.path, expected.path)
    assert len(said.path) == HORIZON_STEPS + 1


def test_it_takes_the_newest_weights_when_it_speaks_and_not_before(moment: Moment):
    speaker, mine = speaks()
    speaker.speak_with(explainer_state())
    before = mine(OBSERVATIONS)
    older, newer = greedy(7), greedy(8)
    assert (newer(OBSERVATIONS) != before).any()
    assert (newer(OBSERVATIONS) != older(OBSERVATIONS)).any()
    speaker.learn(weights_of(older))
    speaker.learn(weights_of(newer))
    np.testing.assert_array_equal(mine(OBSERVATIONS), before)
    speaker.say(moment)
    np.testing.assert_array_equal(mine(OBSERVATIONS), newer(OBSERVATIONS))


def test_weights_are_a_copy_that_learning_does_not_change():
    policy = greedy(1)
    weights = weights_of(policy)
    kept = {name: value.copy() for name, value in weights.items()}
    policy.load_state_dict(greedy(2).state_dict())
    for name, value in weights.items():
        np.testing.assert_array_equal(value, kept[name])
    assert any((policy.state_dict()[name].numpy() != value).any() for name, value in kept.items())


def test_the_newest_vocabulary_is_spoken_with(moment: Moment):
    speaker, _ = speaks()
    speaker.speak_with(explainer_state())
    speaker.speak_with(explainer_state((0.25, 0.25, 0.25)))
    assert speaker.say(moment).expression.tolist() == [0.25]


def test_weights_that_come_while_it_speaks_are_taken_next_time(moment: Moment):
    speaker, mine = speaks(every_s=0.0)
    speaker.speak_with(explainer_state())
    policies = [greedy(seed) for seed in range(3)]
    over = threading.Event()

    def learn() -> None:
        while not over.is_set():
            for policy in policies:
                speaker.learn(weights_of(policy))

    learner = threading.Thread(target=learn)
    learner.start()
    for _ in range(30):
        speaker.say(moment)
    over.set()
    learner.join()
    speaker.say(moment)
    np.testing.assert_array_equal(mine(OBSERVATIONS), policies[-1](OBSERVATIONS))


def test_what_is_told_is_json_and_says_it_all(moment: Moment):
    speaker, _ = speaks()
    speaker.speak_with(explainer_state())
    said = speaker.say(moment)
    shown = json.loads(json.dumps(explanation_fields(said, LANDER_TASK), allow_nan=False))
    assert shown["expression"] == said.expression[0]
    assert shown["said"] == said.said
    assert shown["horizon_steps"] == HORIZON_STEPS
    assert np.shape(shown["path"]) == (HORIZON_STEPS + 1, 2)
    assert explanation_fields(said, WITHOUT_SCENE)["path"] is None


def test_a_calibrated_and_unsure_agent_is_json_too(moment: Moment):
    speaker, _ = speaks()
    features = np.random.default_rng(0).uniform(size=(50, 2))
    calibration = Calibration.fit(features, features[:, 0] > 0.5, CONFIDENCE_FEATURES)
    speaker.speak_with(replace(explainer_state(), calibration=calibration, min_confidence=1.1))
    shown = explanation_fields(speaker.say(moment), WITHOUT_SCENE)
    json.dumps(shown, allow_nan=False)
    assert (shown["known"], type(shown["known"])) == (False, bool)
    assert shown["said"] == "I do not know"


def test_a_word_without_a_known_meaning_has_no_number_and_no_confidence(moment: Moment):
    speaker, _ = speaks()
    known = explainer_state().mapping
    assert isinstance(known, ClusterMapping)
    unknown = replace(known, meanings=(Meaning(negative=False, positive=False),))
    speaker.speak_with(replace(explainer_state(), mapping=unknown))
    shown = explanation_fields(speaker.say(moment), WITHOUT_SCENE)
    assert (shown["said"], shown["in_time"]) == (CANNOT_TELL, CANNOT_TELL)
    assert (shown["meant"], shown["expression"], shown["confidence"]) == (False, None, None)


def test_a_confidence_that_is_no_probability_is_not_shown(moment: Moment):
    speaker, _ = speaks()
    speaker.speak_with(explainer_state())
    shown = explanation_fields(speaker.say(moment), WITHOUT_SCENE)
    assert (shown["meant"], shown["confidence"]) == (True, None)


def test_what_it_would_do_if_told_otherwise_is_json_with_paths(moment: Moment):
    speaker, _ = speaks()
    speaker.speak_with(replace(explainer_state(), what_if=Asking(values_of(LANDER_TASK), futures=1)))
    said = speaker.say(moment)
    fields = json.loads(json.dumps(what_if_fields(said, LANDER_TASK.scene_path)))
    assert [one["told"] for one in fields["what_if"]] == [*values_of(LANDER_TASK)]
    assert [one["said"] for one in fields["what_if"]] == [one.said for one in said.what_if.values()]
    assert np.shape([one["path"] for one in fields["what_if"]]) == (3, HORIZON_STEPS + 1, 2)
    assert 0 <= fields["listens"] <= 1
    assert fields["whatever"] is None or fields["whatever"] == said.phrase
    assert {one["path"] for one in what_if_fields(said, None)["what_if"]} == {None}
    plain = replace(said, what_if={}, listens=None)
    assert what_if_fields(plain, None) == {"what_if": [], "listens": None, "whatever": None}
    assert what_if_fields(replace(said, listens=float("nan")), None)["listens"] is None
