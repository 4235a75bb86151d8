"""An agent that explains itself, from a program: open a run, explain an episode, make a clip, judge the words."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import torch

from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.api.settings import env_config, environment
from ibe_rl.config.command_line import composed
from ibe_rl.config.hydra_setup import settings_at_hand
from ibe_rl.config.limits import check
from ibe_rl.config.overrides import kind_name
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.envs.given import GivesEnv
from ibe_rl.evaluation.compare import compare
from ibe_rl.evaluation.evaluate import evaluate
from ibe_rl.evaluation.narration import check_context, clip_of, explain_rollout, print_narration
from ibe_rl.evaluation.predictors import judge_predictors
from ibe_rl.evaluation.run_predictor import as_trained
from ibe_rl.evaluation.runs import open_trained
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.runtime.apps import load_app
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.storage.run_folder import EVALUATION, FIGURES, POLICY_SUMMARY, read_json
from ibe_rl.storage.whole_folder import unused
from ibe_rl.task import RecordedRollout, Task
from ibe_rl.types import ConfigError, Explanation
from ibe_rl.view.clip_file import check_clip


@dataclass(frozen=True)
class Narration:
    """An explained episode; prints as a table.

    Attributes:
        run: the run of the agent.
        watched: the episode, with all its moments.
        said: the explanation at each step.
    """

    run: TrainedRun
    watched: RecordedRollout
    said: Sequence[Explanation]

    def __str__(self) -> str:
        stream = io.StringIO()
        # in a notebook too, where rich would show it at once instead, in colours
        plain = PlainConsole(file=stream, force_jupyter=False, force_terminal=False)
        print_narration(self.run, self.watched, self.said, plain)
        return stream.getvalue()

    def clip(self, path: str | Path) -> Path:
        """Write the episode with its explanations as a moving picture.

        Args:
            path: of the file to write, ``.gif`` or ``.mp4``.

        Returns:
            the path.

        Raises:
            ConfigError: if it can be neither, or not be written.
        """
        return clip_of(self.run, self.watched, self.said, Path(path))


@dataclass(frozen=True)
class ExplainedAgent:
    """An agent and its vocabulary; ``run.folder`` holds both, but no agent that was trained elsewhere.

    Attributes:
        run: the opened run.
        config: settings of the explanation.
    """

    run: TrainedRun
    config: ExplainConfig

    def explain(self, seed: int = 0, context: str | None = None) -> Narration:
        """Roll out one more episode and explain each step.

        Args:
            seed: of the episode.
            context: of the episode; None draws one.

        Raises:
            ConfigError: for an unknown context.
        """
        check_context(context, self.run)
        torch.set_num_threads(1)
        return Narration(self.run, *explain_rollout(self.run, replace(self.config, seed=seed, context=context)))

    def what_if(self, seed: int = 0, context: str | None = None, every_steps: int = 20) -> list[Explanation]:
        """What the agent would do at moments of one more episode if it were told each value for the next n steps.

        Args:
            seed: of the episode.
            context: of the episode; None draws one.
            every_steps: from one moment to the next.

        Returns:
            an explanation of each moment: ``what_if`` holds the answers by what is told, ``listens`` their spread.

        Raises:
            ConfigError: for an unknown context, or ``every_steps`` below 1.
        """
        if every_steps < 1:
            raise ConfigError(f"every_steps={every_steps}: allowed is at least 1")
        check_context(context, self.run)
        torch.set_num_threads(1)
        config = replace(self.config, seed=seed, context=context, what_if=True)
        return explain_rollout(self.run, config, every_steps)[1]

    def clip(self, path: str | Path, seed: int = 0, context: str | None = None) -> Path:
        """Explain one more episode and write it as a moving picture, ``.gif`` or ``.mp4``; returns the path.

        Args:
            path: of the file to write.
            seed: of the episode.
            context: of the episode; None draws one.

        Raises:
            ConfigError: if it can be neither, or not be written.
        """
        check_clip(Path(path), "path")
        return self.explain(seed, context).clip(path)

    def evaluate(self) -> Any:
        """Evaluate the explanations, as ``task=evaluate``: prints tables, writes ``evaluation/`` and ``figures/``.

        Returns:
            the contents of ``evaluation/quality.json``.
        """
        return self._do(evaluate, "quality.json")

    def compare(self) -> Any:
        """Compare the kinds of vocabulary, as ``task=compare``; returns the contents of ``evaluation/compare.json``."""
        return self._do(compare, "compare.json")

    def predictors(self) -> Any:
        """Compare the predictors, as ``task=predictors``; returns the contents of ``evaluation/predictors.json``.

        Raises:
            ConfigError: for an agent that was trained elsewhere.
        """
        self._refuse_external("predictors")
        return self._do(judge_predictors, "predictors.json")

    def figures(self) -> Path:
        """Repeat the paper's experiments, as ``task=figures``; returns the path of the report.

        Raises:
            ConfigError: for an agent that was trained elsewhere.
        """
        self._refuse_external("figures")
        self._do(load_app("task=figures"), "paper.json")
        return self.run.folder / FIGURES / "report.html"

    def summarise(self) -> Any:
        """Sum up what the agent does, as ``task=summary``; returns the contents of ``summary/summary.json``."""
        return self._do(load_app("task=summary"), "summary.json", POLICY_SUMMARY)

    def _do(self, task: Callable[[TrainedRun, ExplainConfig], None], result: str, folder: str = EVALUATION) -> Any:
        with settings_at_hand():
            task(self.run, self.config)
        return read_json(self.run.folder / folder / result)

    def _refuse_external(self, task: str) -> None:
        if isinstance(self.run.config.agent, ExternalPolicyConfig):
            raise ConfigError(f"task={task} with agent=: allowed is a run of train.py, which this agent has none of")


def open_run(
    run: str | Path | None = None,
    agent: Any = None,
    settings: Sequence[str] = (),
    *,
    env: str | GivesEnv | None = None,
    task: Task | None = None,
    trusted: Sequence[str | type] = (),
) -> ExplainedAgent:
    """Open the folder of a run. No code that the folder names is run, unless it comes with ibe_rl or you name it.

    Args:
        run: the folder; None: the newest below ``runs/``.
        agent: for a folder of ``explain_agent`` or of an imported log: the agent, which the folder does not hold.
        settings: of ``explain.py``, as on its command line.
        env: as in ``ibe_rl.settings``; needed if the run was given an environment by a program.
        task: of that environment; None: its own attribute ``task``.
        trusted: kinds whose code may be run although no config file names them: classes, or ``module:Class``.

    Raises:
        ConfigError: if it is not such a folder, or agent or environment do not fit.
    """
    config: ExplainConfig = replace(composed("explain", settings), run=None if run is None else str(run))
    known, names = env_config(env, task), [kind_name("trusted", one) for one in trusted]
    if agent is None:
        opened = open_trained(config.run, None, known, names)
    else:
        opened = load_app("open_run(agent=)")(agent, config, known, names)
    return ExplainedAgent(opened, as_trained(config, opened, {one.partition("=")[0] for one in settings}))


def explain_agent(
    agent: Any,
    env: str | GivesEnv | None = None,
    *,
    task: Task | None = None,
    episodes: int = 200,
    random_actions: float = 0.0,
    agent_sees_instruction: bool | None = None,
    run_dir: str | Path | None = None,
    seed: int = 0,
    settings: Sequence[str] = (),
) -> ExplainedAgent:
    """Learn a vocabulary from episodes of any agent, to explain it.

    Args:
        agent: a ``.zip`` of stable-baselines3 or sb3-contrib (loading it runs code), ``module:name``, a model of these
            libraries, a policy module of TorchRL, a function from observations ``(N, ·)``, or one ``(·,)``, to
            actions, or a function without arguments that makes any of these.
        env: as in ``ibe_rl.settings``.
        task: what the environment declares; None: its own attribute ``task``.
        episodes: how many to roll out.
        random_actions: share of random actions in them, where all episodes would be alike otherwise.
        agent_sees_instruction: whether the agent reads the instruction after the state; None takes it from the agent.
        run_dir: the folder to make; None makes one below ``runs/``.
        seed: of the episodes and of the clustering.
        settings: of ``explain.py``, as on its command line, such as ``"mapping.horizon_steps=40"``.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    chosen, given = environment(env, task)
    config: ExplainConfig = composed("explain", [*chosen, *settings])
    folder = run_dir or unused(Path(datetime.now().astimezone().strftime("runs/%Y-%m-%d_%H-%M-%S")))
    config = replace(
        config,
        episodes=episodes,
        random_actions=random_actions,
        agent_sees_instruction=agent_sees_instruction,
        run_dir=str(folder),
    )
    check(config)
    return ExplainedAgent(load_app("explain_agent")(agent, config, seed, given), config)
