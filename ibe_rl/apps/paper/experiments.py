"""``task=figures``: do the paper's experiments again with the agents of one run, and tell what came out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
import torch

from ibe_rl.apps.paper import movements, vocabularies
from ibe_rl.apps.paper.agents import PaperAgent
from ibe_rl.apps.paper.answers import headlines
from ibe_rl.apps.paper.names import AT_CONTACT, AT_END, DEFAULT, PAPERS
from ibe_rl.apps.paper.page import write_report
from ibe_rl.apps.paper.prediction_task import (
    ObservedEpisodes,
    ShownEpisode,
    ask_observers,
    error_tests,
    most_telling,
    pick_episodes,
)
from ibe_rl.apps.paper.report_context import ReportContext, find_agents, hidden_goal_env, report_protocol
from ibe_rl.config.report_settings import FiguresConfig
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.envs.make import make_env
from ibe_rl.evaluation import tables
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.refit import fit_shuffled
from ibe_rl.evaluation.report import make_folders
from ibe_rl.evaluation.run_predictor import PROCESSES, predictor_of, with_processes
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.ibe.delta import cut_windows
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.metrics.effect import corrected
from ibe_rl.metrics.observer import Observer, calibrate_observer
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.storage.run_folder import EVALUATION, FIGURES, write_json
from ibe_rl.types import Array, ConfigError, Episode, ExpressionMapping

ByAgentAndCut = dict[str, dict[str, ObservedEpisodes]]
TRIES_EACH = 10
"""Most episodes rolled out for each episode of the prediction task."""


def reproduce(run: TrainedRun, cfg: ExplainConfig) -> None:
    """Find agents A, B and C of a run, do the paper's experiments with them, write numbers, figures and the report.

    Raises:
        ConfigError: if the run lacks what is needed, or its episodes teach no vocabulary.
    """
    torch.set_num_threads(1)
    context = ReportContext(run, cfg)
    make_folders(context.run.folder)
    say = PlainConsole(soft_wrap=True).print
    found, observed = experiment(context, say)
    write_json(context.run.folder / EVALUATION / "paper.json", found)
    say("drawing")
    pictures, page = write_report(context.run.folder / FIGURES, found, observed)
    console = tables.console()
    for line in headlines(found):
        console.print(f"- {line}")
    say(f"numbers: {context.run.folder / EVALUATION}/paper.json")
    say(f"figures: {len(pictures)} PNG files in {page.parent}")
    say(f"report:  {page}")


def experiment(context: ReportContext, say: Callable[[str], None]) -> tuple[dict[str, Any], ByAgentAndCut]:
    """Do them all; returns what paper.json holds, and the episodes of the prediction task."""
    agents, screened = find_agents(context)
    say(", ".join(f"{one.name}: {100 * one.success.value:.1f} % after {one.frame:,} frames" for one in agents))
    task = context.task
    name, unit = task.state_names[task.explained[0]], task.state_units[task.explained[0]]
    found: dict[str, Any] = {
        "protocol": report_protocol(context),
        "phrases": {str(value): phrase(np.array([value]), task.phrases) for value in task.instruction_values},
        "change_label": f"change of {name} ({unit})",
        "screened": screened,
        "agents": [agent_json(one) for one in agents],
        "preliminary": [preliminary(context, one) for one in agents],
        **{part: [] for part in ("expressions", "straight", "prediction")},
    }
    observed: ByAgentAndCut = {}
    for agent in agents[1:]:
        count = context.config.prediction_episodes
        say(f"agent {agent.name}: vocabularies, and {count} episodes for the prediction task")
        taught, seeds = teach(context, agent), context.seeds("checked", context.config.checked_episodes)
        checked = context.runner.run(agent.policy, seeds)
        observed[agent.name] = foretell(context, agent, taught[0], checked)
        found["expressions"].append(expressions_of(context, agent, taught[0]))
        found["straight"].append(called_straight(context, agent, taught, checked))
        found["prediction"].append(prediction(agent, observed[agent.name], context.config))
    correct(found["prediction"])
    return found, observed


def agent_json(agent: PaperAgent) -> dict[str, Any]:
    """Which policy it is and how good it is."""
    return {
        "name": agent.name,
        "frame": agent.frame,
        "wanted": agent.wanted,
        "episodes": len(agent.episodes),
        "success": agent.success.to_dict(),
        "near": agent.near,
        "return_mean": float(np.mean([episode.total_reward for episode in agent.episodes])),
        "steps_mean": float(np.mean([len(episode) for episode in agent.episodes])),
    }


def preliminary(context: ReportContext, agent: PaperAgent) -> dict[str, Any]:
    """The histograms, and the claim tested, for each instruction."""
    fraction = context.mappings[PAPERS].top_fraction
    made = movements.movements_of(agent.episodes, context.task, context.horizon_steps, fraction)
    by_instruction = {}
    for value in context.task.instruction_values:
        claims = movements.claim_effects(made, value, context.config.resamples, context.config.seed)
        by_instruction[str(value)] = movements.histogram(made, value) | {
            "claim": {over: movements.effect_json(one) for over, one in claims.items()}
        }
    return {"agent": agent.name, "told": by_instruction}


def teach(context: ReportContext, agent: PaperAgent) -> list[dict[str, ClusterMapping]]:
    """Learn all vocabularies from the agent's episodes, again and again with other starts of the clustering.

    Raises:
        ConfigError: if the episodes are too few.
    """
    found = []
    with progress_bar(f"vocabularies of agent {agent.name}", context.config.clusterings) as step:
        for number in range(context.config.clusterings):
            try:
                seed = context.config.seed + number
                found.append(
                    vocabularies.learn_variants(
                        agent.episodes, context.mappings, context.task, context.horizon_steps, seed
                    )
                )
            except TooLittleDataError as error:
                raise ConfigError(
                    f"figures.episodes={context.config.episodes}: agent {agent.name}'s give no vocabulary ({error}); "
                    "allowed are more of them, or a run that learnt more"
                ) from None
            step()
    return found


def expressions_of(context: ReportContext, agent: PaperAgent, taught: dict[str, ClusterMapping]) -> dict[str, Any]:
    """The clusters of the paper's and of our vocabulary."""
    limit = {"straight_below": vocabularies.straight_below(context.task.phrases[0])}
    results = {name: vocabularies.vocabulary_json(taught[name]) | limit for name in (PAPERS, DEFAULT)}
    return {"agent": agent.name, "vocabularies": results}


def called_straight(
    context: ReportContext, agent: PaperAgent, taught: Sequence[dict[str, ClusterMapping]], checked: Sequence[Episode]
) -> dict[str, Any]:
    """When movements are called straight, in all vocabularies and on episodes that none was learnt from."""
    tested = vocabularies.call(
        checked, taught, context.task, context.horizon_steps, context.config.resamples, context.config.seed
    )
    skews = {name: [vocabularies.skew(learnt[name]) for learnt in taught] for name in taught[0]}
    return {
        "agent": agent.name,
        "clusterings": len(taught),
        "small": [[bands * tested.band for bands in vocabularies.SMALL]],
        "by_movement": {name: vocabularies.rates_by_movement(tested, name) for name in (PAPERS, DEFAULT)},
        "rates": vocabularies.small_rates(tested),
        "skews": skews,
    }


def foretell(
    context: ReportContext, agent: PaperAgent, taught: dict[str, ClusterMapping], checked: Sequence[Episode]
) -> dict[str, ObservedEpisodes]:
    """Let observers foretell the end of episodes in which the goal cannot be seen; for each cut."""
    env, predictor_config = context.run.config.env, context.cfg.predictor
    hidden = hidden_goal_env(env, context.task)
    known = {name: taught[name] for name in (PAPERS, DEFAULT)}
    shuffled, observer = learn_shuffled(context, agent), typical(context, agent, checked)
    shown = hidden_episodes(context, agent, make_env(hidden))
    found = {}
    with predictor_of(
        context.run, with_processes(predictor_config, PROCESSES), context.config.seed, hidden
    ) as predictor:
        for cut in (AT_END, AT_CONTACT):
            found[cut] = ask_observers(
                shown,
                cut,
                agent.policy,
                predictor,
                known,
                shuffled=shuffled,
                observer=observer,
                task=context.task,
                horizon_steps=context.horizon_steps,
                futures=predictor_config.futures,
            )
    return found


def learn_shuffled(context: ReportContext, agent: PaperAgent) -> list[ExpressionMapping]:
    """Vocabularies that cannot be right.

    Raises:
        ConfigError: if none can be learnt.
    """
    ours, config = context.mappings[DEFAULT], context.config
    best = vocabularies.best_of(agent.episodes, ours)
    with progress_bar("vocabularies of shuffled instructions", config.shuffles) as step:
        found = fit_shuffled(
            best, agent.episodes, ours, context.task, config.seed, context.horizon_steps, config.shuffles, step
        )
    if not found:
        raise ConfigError(
            f"figures.shuffles={config.shuffles}: none of them gave a vocabulary; allowed are more figures.episodes"
        )
    return found


def hidden_episodes(context: ReportContext, agent: PaperAgent, env: gymnasium.Env[Any, Any]) -> list[ShownEpisode]:
    """Episodes in which the goal cannot be seen.

    Raises:
        ConfigError: if the agent hardly ever comes down.
    """
    count, steps = context.config.prediction_episodes, context.horizon_steps
    with progress_bar(f"agent {agent.name}: rollouts with the goal hidden", count) as step:
        seeds = context.seeds("foretold", TRIES_EACH * count)
        shown = pick_episodes(env, context.task, agent.policy, context.instructor, seeds, count, steps, step)
    if len(shown) < 2:
        raise ConfigError(
            f"run={context.run.folder}: agent {agent.name} hardly ever comes down after at least {SEEN_STEPS + steps} "
            "steps; allowed is a run that learnt more"
        )
    return shown


def typical(context: ReportContext, agent: PaperAgent, checked: Sequence[Episode]) -> Observer:
    """An observer that knows how far the agent typically goes.

    Raises:
        ConfigError: if it never goes anywhere.
    """
    change = cut_windows(checked, context.horizon_steps, "clamp").delta[:, context.task.explained[0]]
    observer = calibrate_observer(change.astype(float), context.task.explained_band[0])
    if np.isnan(observer.typical):
        raise ConfigError(
            f"run={context.run.folder}: agent {agent.name} never goes to a side within {context.horizon_steps} steps; "
            "allowed is a run that does, or one with a longer mapping.horizon_steps"
        )
    return observer


def prediction(agent: PaperAgent, observed: dict[str, ObservedEpisodes], config: FiguresConfig) -> dict[str, Any]:
    """How far off the observers are, over all episodes and in each."""
    cuts = {}
    for cut, one in observed.items():
        errors = one.errors()
        means, tests = error_tests(errors, config.resamples, config.seed)
        cuts[cut] = {
            "error": {name: each.to_dict() for name, each in means.items()},
            "tests": tests,
            "most_telling": {name: most_telling(errors, name) for name in one.vocabularies},
            "episodes": [episode_json(one, row, errors) for row in range(len(one.shown))],
        }
    return {"agent": agent.name, "cuts": cuts}


def episode_json(observed: ObservedEpisodes, row: int, errors: dict[str, Array]) -> dict[str, Any]:
    """One episode of the prediction task."""
    shown = observed.shown[row]
    return {
        "seed": shown.seed,
        "context": shown.watched.episode.context,
        "success": shown.watched.episode.success,
        "foretold_at_step": observed.last_seen(row),
        "position": float(observed.position[row]),
        "end": float(observed.end[row]),
        "said": {name: said[row].tolist() for name, said in observed.said.items()},
        "expected": {name: float(np.mean(each[:, row])) for name, each in observed.expected.items()},
        "errors": {name: float(each[row]) for name, each in errors.items()},
    }


def correct(predictions: Sequence[dict[str, Any]]) -> None:
    """Correct the p of all tests for how many they are."""
    tests = [test for agent in predictions for cut in agent["cuts"].values() for test in cut["tests"]]
    for test, p in zip(tests, corrected([test["p"] for test in tests]), strict=True):
        test["p_corrected"] = p
