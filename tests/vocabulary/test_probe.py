"""What refreshes are held against stays the same, and is what it says it is."""

from pathlib import Path

import numpy as np
import pytest
from by_hand import STEPS, TASK, add, config, defy, obey, race, stay

from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, observe
from ibe_rl.vocabulary import probe as module
from ibe_rl.vocabulary.tracker import Probe, VocabularyTracker, draw_probe


def test_the_probe_stays_the_same(log: TrajectoryLog):
    obey(log)
    development, asked = VocabularyTracker(config(), TASK, seed=0), []

    def noting(observations: Array) -> Array:
        asked.append(observations)
        return stay(observations)

    development.refresh(log, noting)
    probe = development.probe
    assert probe is not None
    delta, observations = probe.delta.copy(), probe.observations.copy()
    for fly in (defy, race):
        fly(log)
        development.refresh(log, noting)
        assert development.probe is probe
        np.testing.assert_array_equal(probe.delta, delta)
        np.testing.assert_array_equal(probe.observations, observations)
    assert len(asked) == 3
    assert all(each is probe.observations for each in asked)


def test_the_probe_is_where_windows_began_and_how_they_ended(log: TrajectoryLog):
    obey(log)
    add(log, -9.0, 1.0, given=False)  # bad ones and silent ones too
    probe = draw_probe(log, config(), seed=0)
    assert probe.delta.shape == (4 * 8, 3)
    assert (probe.observations.shape, probe.observations.dtype) == ((4 * 8, 5), np.float32)
    expected = set()
    for episode in log.read(range(4)):
        for step in range(8):
            seen = observe(episode.states[step], episode.instructions[step], episode.given[step : step + 1])
            expected.add((*seen.tolist(), *(episode.states[step + 5] - episode.states[step]).tolist()))
    found = zip(probe.observations.tolist(), probe.delta.tolist(), strict=True)
    assert {(*seen, *delta) for seen, delta in found} == expected


def test_the_probe_is_a_sample(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    for _ in range(4):
        obey(log)
    monkeypatch.setattr(module, "PROBE_EPISODES", 5)
    assert len(draw_probe(log, config(), seed=0).delta) == 5 * 8
    assert len(draw_probe(log, config(window_end="clamp"), seed=0).delta) == 5 * STEPS
    monkeypatch.setattr(module, "PROBE_WINDOWS", 30)
    drawn = [draw_probe(log, config(), seed).observations for seed in (0, 0, 1)]
    assert len(drawn[0]) == 30
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert (drawn[0] != drawn[2]).any()


def test_the_probe_is_drawn_from_episodes_that_a_window_fits_into(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "PROBE_EPISODES", 1)
    for _ in range(30):
        add(log, 1.0, 1.0, steps=4)
    add(log, 1.0, 1.0, steps=5)
    for seed in range(5):
        assert len(draw_probe(log, config(), seed).delta) == 1


def test_a_probe_comes_back_without_running_code(tmp_path: Path):
    probe = Probe(np.arange(6.0).reshape(2, 3), np.ones((2, 5), np.float32))
    probe.save(tmp_path / "probe.npz")
    with np.load(tmp_path / "probe.npz", allow_pickle=False) as saved:
        assert set(saved) == {"delta", "observations"}
        np.testing.assert_array_equal(saved["delta"], probe.delta)
        np.testing.assert_array_equal(saved["observations"], probe.observations)
        assert saved["observations"].dtype == np.float32
    assert [path.name for path in tmp_path.iterdir()] == ["probe.npz"]
