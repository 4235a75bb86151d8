"""``task=figures``: do the paper's experiments again with the agents of one run, and tell what came out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import torch
from rich.console import Console

from ibe_rl.apps.paper import moves, words
from ibe_rl.apps.paper.agents import Skilled
from ibe_rl.apps.paper.answers import headlines
from ibe_rl.apps.paper.foretelling import CONTACT, END, Shown, judged, listen, most_telling, pick
from ibe_rl.apps.paper.page import write_report
from ibe_rl.apps.paper.report_context import Lab, find_agents, protocol
from ibe_rl.apps.paper.strips import Told
from ibe_rl.apps.paper.words import OURS, PAPER
from ibe_rl.config.settings import ExplainConfig, FiguresConfig
from ibe_rl.envs.make import make_game
from ibe_rl.evaluation import tables
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.refit import fit_shuffled
from ibe_rl.evaluation.report import make_folders
from ibe_rl.evaluation.run_predictor import PROCESSES, predictor_of, with_processes
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.ibe import ClusterMapping, TooLittleDataError, cut_windows, phrase
from ibe_rl.metrics.effect import corrected
from ibe_rl.metrics.observer import Observer, calibrate_observer
from ibe_rl.storage.run_folder import EVALUATION, FIGURES, write_json
from ibe_rl.types import Array, ConfigError, Episode, Mapping

TRIES = 10
"""How many episodes are flown at most for each that observers foretell."""


def reproduce(run: TrainedRun, cfg: ExplainConfig) -> None:
    """Find agents A, B and C of a run, do the paper's experiments with them, write numbers, figures and the report.

    Raises:
        ConfigError: if the run lacks what is needed, or its episodes teach no vocabulary.
    """
    torch.set_num_threads(1)
    lab = Lab(run, cfg)
    make_folders(lab.run.folder)
    say = Console(highlight=False, soft_wrap=True).print
    found, told = experiment(lab, say)
    write_json(lab.run.folder / EVALUATION / "paper.json", found)
    say("drawing")
    pictures, page = write_report(lab.run.folder / FIGURES, found, told)
    console = tables.console()
    for line in headlines(found):
        console.print(f"- {line}")
    console.print(f"numbers: {lab.run.folder / EVALUATION}/paper.json", soft_wrap=True)
    console.print(f"figures: {len(pictures)} PNG files in {page.parent}", soft_wrap=True)
    console.print(f"report:  {page}", soft_wrap=True)


def experiment(lab: Lab, say: Callable[[str], None]) -> tuple[dict[str, Any], dict[str, dict[str, Told]]]:
    """Do them all; returns what paper.json holds, and the episodes of the prediction task by agent and cut."""
    agents, screened = find_agents(lab)
    say(", ".join(f"{one.name}: {100 * one.success.value:.1f} % after {one.frame:,} frames" for one in agents))
    name, unit = lab.task.state_names[lab.task.explained[0]], lab.task.state_units[lab.task.explained[0]]
    found: dict[str, Any] = {
        "protocol": protocol(lab),
        "phrases": {str(value): phrase(np.array([value]), lab.task.phrases) for value in lab.task.instruction_values},
        "change_label": f"change of {name} ({unit})",
        "screened": screened,
        "agents": [agent_json(one) for one in agents],
        "preliminary": [preliminary(lab, one) for one in agents],
        **{part: [] for part in ("expressions", "straight", "prediction")},
    }
    told = {}
    for agent in agents[1:]:
        say(f"agent {agent.name}: vocabularies, and {lab.config.prediction_episodes} episodes to be foretold")
        taught, checked = teach(lab, agent), lab.fly(agent.policy, lab.seeds("checked", lab.config.checked_episodes))
        told[agent.name] = foretell(lab, agent, taught[0], checked)
        found["expressions"].append(expressions(lab, agent, taught[0]))
        found["straight"].append(straight(lab, agent, taught, checked))
        found["prediction"].append(prediction(agent, told[agent.name], lab.config))
    correct(found["prediction"])
    return found, told


def agent_json(agent: Skilled) -> dict[str, Any]:
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


def preliminary(lab: Lab, agent: Skilled) -> dict[str, Any]:
    """The histograms, and the claim tested, for each instruction."""
    fraction = lab.mappings[PAPER].top_fraction
    made = moves.moves_of(agent.episodes, lab.task, lab.horizon_steps, fraction)
    told = {}
    for value in lab.task.instruction_values:
        claims = moves.claim(made, value, lab.config.resamples, lab.config.seed)
        told[str(value)] = moves.histogram(made, value) | {
            "claim": {over: moves.as_json(one) for over, one in claims.items()}
        }
    return {"agent": agent.name, "told": told}


def teach(lab: Lab, agent: Skilled) -> list[dict[str, ClusterMapping]]:
    """Learn all vocabularies from the agent's episodes, again and again with other starts of the clustering.

    Raises:
        ConfigError: if the episodes are too few.
    """
    found = []
    with progress_bar(f"vocabularies of agent {agent.name}", lab.config.clusterings) as step:
        for number in range(lab.config.clusterings):
            try:
                seed = lab.config.seed + number
                found.append(words.learn(agent.episodes, lab.mappings, lab.task, lab.horizon_steps, seed))
            except TooLittleDataError as error:
                raise ConfigError(
                    f"figures.episodes={lab.config.episodes}: agent {agent.name}'s teach no vocabulary ({error}); "
                    "allowed are more of them, or a run that learnt more"
                ) from None
            step()
    return found


def expressions(lab: Lab, agent: Skilled, taught: dict[str, ClusterMapping]) -> dict[str, Any]:
    """The clusters of the paper's and of our vocabulary."""
    limit = {"straight_below": words.straight_below(lab.task.phrases[0])}
    told = {name: words.vocabulary_json(taught[name]) | limit for name in (PAPER, OURS)}
    return {"agent": agent.name, "vocabularies": told}


def straight(
    lab: Lab, agent: Skilled, taught: Sequence[dict[str, ClusterMapping]], checked: Sequence[Episode]
) -> dict[str, Any]:
    """When movements are called straight, in all vocabularies and on episodes that none was learnt from."""
    tested = words.call(checked, taught, lab.task, lab.horizon_steps, lab.config.resamples, lab.config.seed)
    skews = {name: [words.skew(learnt[name]) for learnt in taught] for name in taught[0]}
    return {
        "agent": agent.name,
        "clusterings": len(taught),
        "small": [[bands * tested.band for bands in words.SMALL]],
        "by_movement": {name: words.rates_by_movement(tested, name) for name in (PAPER, OURS)},
        "rates": words.small_rates(tested),
        "skews": skews,
    }


def foretell(
    lab: Lab, agent: Skilled, taught: dict[str, ClusterMapping], checked: Sequence[Episode]
) -> dict[str, Told]:
    """Let observers foretell the end of episodes in which the goal cannot be seen; for each cut."""
    env, predictor_config = lab.run.config.env, lab.cfg.predictor
    hidden = replace(env, kwargs={**env.kwargs, **lab.task.hidden_goal})
    vocabularies = {name: taught[name] for name in (PAPER, OURS)}
    told_by = vocabularies, learn_shuffled(lab, agent), typical(lab, agent, checked)
    shown = hidden_flights(lab, agent, make_game(hidden))
    workers = with_processes(predictor_config, PROCESSES)
    horizon_steps, told = lab.horizon_steps, {}
    with predictor_of(lab.run, workers, lab.config.seed, hidden) as predictor:
        for cut in (END, CONTACT):
            about = shown, cut, agent.policy, predictor
            listened = listen(*about, *told_by, lab.task, horizon_steps, predictor_config.futures)
            told[cut] = Told(shown, cut, listened, vocabularies, lab.task, horizon_steps)
    return told


def learn_shuffled(lab: Lab, agent: Skilled) -> list[Mapping]:
    """Vocabularies that cannot be right.

    Raises:
        ConfigError: if none can be learnt.
    """
    ours, config = lab.mappings[OURS], lab.config
    best = words.best_of(agent.episodes, ours)
    with progress_bar("vocabularies of shuffled instructions", config.shuffles) as step:
        settings = ours, lab.task, config.seed, lab.horizon_steps, config.shuffles
        found = fit_shuffled(best, agent.episodes, *settings, step)
    if not found:
        raise ConfigError(
            f"figures.shuffles={config.shuffles}: none of them taught a vocabulary; allowed are more figures.episodes"
        )
    return found


def hidden_flights(lab: Lab, agent: Skilled, env: gymnasium.Env[Any, Any]) -> list[Shown]:
    """Episodes in which the goal cannot be seen.

    Raises:
        ConfigError: if the agent hardly ever comes down.
    """
    count, steps = lab.config.prediction_episodes, lab.horizon_steps
    with progress_bar(f"agent {agent.name} flies where the goal is hidden", count) as step:
        seeds = lab.seeds("foretold", TRIES * count)
        shown = pick(env, lab.task, agent.policy, lab.instructor, seeds, count, steps, step)
    if len(shown) < 2:
        raise ConfigError(
            f"run={lab.run.folder}: agent {agent.name} hardly ever comes down after at least {SEEN_STEPS + steps} "
            "steps; allowed is a run that learnt more"
        )
    return shown


def typical(lab: Lab, agent: Skilled, checked: Sequence[Episode]) -> Observer:
    """An observer that knows how far the agent typically goes.

    Raises:
        ConfigError: if it never goes anywhere.
    """
    change = cut_windows(checked, lab.horizon_steps, "clamp").delta[:, lab.task.explained[0]]
    observer = calibrate_observer(change.astype(float), lab.task.explained_band[0])
    if np.isnan(observer.typical):
        raise ConfigError(
            f"run={lab.run.folder}: agent {agent.name} never goes to a side within {lab.horizon_steps} steps; "
            "allowed is a run that does, or one with a longer mapping.horizon_steps"
        )
    return observer


def prediction(agent: Skilled, told: dict[str, Told], config: FiguresConfig) -> dict[str, Any]:
    """How far off the observers are, over all episodes and in each."""
    cuts = {}
    for cut, one in told.items():
        errors = one.listened.errors(one.task.explained_range[0])
        means, tests = judged(errors, config.resamples, config.seed)
        cuts[cut] = {
            "error": {name: each.to_dict() for name, each in means.items()},
            "tests": tests,
            "most_telling": {name: most_telling(errors, name) for name in one.vocabularies},
            "episodes": [episode_json(one, row, errors) for row in range(len(one.shown))],
        }
    return {"agent": agent.name, "cuts": cuts}


def episode_json(told: Told, row: int, errors: dict[str, Array]) -> dict[str, Any]:
    """One episode of the prediction task."""
    shown, listened = told.shown[row], told.listened
    return {
        "seed": shown.seed,
        "context": shown.watched.episode.context,
        "success": shown.watched.episode.success,
        "foretold_at_step": told.last_seen(row),
        "position": float(listened.position[row]),
        "end": float(listened.end[row]),
        "said": {name: said[row].tolist() for name, said in listened.said.items()},
        "expected": {name: float(np.mean(each[:, row])) for name, each in listened.expected.items()},
        "errors": {name: float(each[row]) for name, each in errors.items()},
    }


def correct(predictions: Sequence[dict[str, Any]]) -> None:
    """Correct the p of all tests for how many they are."""
    tests = [test for agent in predictions for cut in agent["cuts"].values() for test in cut["tests"]]
    for test, p in zip(tests, corrected([test["p"] for test in tests]), strict=True):
        test["p_corrected"] = p
