"""What README and docs/API.md show works as it stands there; test_commands.py runs the commands."""

import re
import subprocess
from pathlib import Path

import numpy as np

from ibe_rl import Episode

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def walk_to_the_middle(start: float, random: np.random.Generator) -> Episode:
    """Told to go there, it does, by .05 a step; the second number of the state says nothing."""
    place, instruction = [start], []
    for _ in range(40):
        instruction.append(float(np.sign(-place[-1]) * (abs(place[-1]) > 0.1)))
        place.append(place[-1] + 0.05 * instruction[-1] + random.normal(0, 0.01))
    states, nothing = np.column_stack([place, random.normal(size=41)]), np.zeros(40)
    return Episode(states, nothing, nothing, np.array(instruction)[:, None], np.ones(40, bool), False, False, "any")


def python_of(text: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def test_it_can_be_read_at_once() -> None:
    assert len(README.splitlines()) <= 120


def test_the_lines_of_python_run() -> None:
    [theirs] = python_of(README)
    assert theirs in (ROOT / "docs" / "OWN_AGENT.md").read_text()  # whose blocks are run in test_own_docs.py
    [block] = [one for one in python_of((ROOT / "docs" / "API.md").read_text()) if "(W, S)" in one]
    random = np.random.default_rng(0)
    way = random.integers(-1, 2, 300)
    delta_states = np.column_stack([0.2 * way, np.zeros(300)]) + random.normal(0, 0.01, (300, 2))
    names = {"delta_states": delta_states, "instructions": way, "new_delta_states": np.array([[-0.2, 0], [0.2, 0]])}
    names |= {
        "states": np.column_stack([-way, random.normal(size=300)]) + random.normal(0, 0.01, (300, 2)),
        "state_instructions": way,
    }
    names["episodes"] = [walk_to_the_middle(start, random) for start in np.linspace(-1, 1, 20)]
    exec(block, names)  # noqa: S102 - our own page
    mapping = names["mapping"]
    np.testing.assert_array_equal(mapping.predict(names["new_delta_states"]), [[-1.0], [1.0]])
    assert names["found"].meanings[0].known
    assert names["axis"].meanings_ == names["found"].meanings
    np.testing.assert_allclose(names["axis"].predict(names["new_delta_states"]), [[-1.0], [1.0]], atol=0.05)


def test_the_make_targets_exist_and_are_listed() -> None:
    listed = subprocess.run(["make"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    named = set(re.findall(r"(?<!study )\bmake ([a-z]+)\b", README)) - {"are"}
    assert named == {"train", "test", "demo", "docs"}
    for target in named:
        assert f"make {target}" in listed


def test_the_files_it_links_to_are_there() -> None:
    for link in re.findall(r"\]\((?!http)([^)]+)\)", README):
        assert (ROOT / link).exists(), link
