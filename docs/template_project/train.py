"""Train an agent in the corridor, let it explain an episode, and write that as a clip: python train.py."""

from typing import Any

from my_project.environment import Corridor
from my_project.listener import Diary
from my_project.mapping import QuietMapping

import ibe_rl


def train(run_dir: str, **values: Any) -> ibe_rl.ExplainedAgent:
    """Train with all that is our own; ``values`` are further settings."""
    settings = ibe_rl.settings(
        env=Corridor, mapping={"kind": QuietMapping, "quiet": 0.1}, viewer="off", run_dir=run_dir, **values
    )
    with ibe_rl.build(settings, listeners=[Diary()]) as run:
        ibe_rl.train(run)
    return ibe_rl.open_run(run_dir, env=Corridor, trusted=[QuietMapping])


if __name__ == "__main__":
    explained = train("runs/corridor_python", total_frames=200_000)
    print(explained.explain(seed=3))
    print(explained.clip("corridor.gif", seed=3))
