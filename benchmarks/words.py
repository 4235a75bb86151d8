"""Words of one's own: are they told apart, and spoken as they were used? From the logs of trained runs, told anew.

python -m benchmarks.words RUN RUN RUN                  lander runs that are there already; ten minutes
python -m benchmarks.words --missing RUN RUN RUN        only what benchmarks/words.json does not hold yet of these runs
python -m benchmarks.words --report                     the table only, in docs/WORDS.md

The states and actions of a log stay. At each step a rule says a word in place of the number. Vocabularies are learnt
from that as in ``task=evaluate``, and judged on greedy episodes that are not in the log.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from benchmarks.pages import fill
from benchmarks.truth_report import DOCS
from benchmarks.which_training import training_of
from ibe_rl.collect.rollout import play
from ibe_rl.config.settings import InstructorConfig, MappingConfig
from ibe_rl.envs.lander_task import LANDER_TASK
from ibe_rl.envs.lander_words_task import FALL_LEFT, FALL_RIGHT, FASTER, HOLD, LANDER_WORDS_TASK, SLOWER
from ibe_rl.envs.worded import worded
from ibe_rl.evaluation.refit import Refits
from ibe_rl.evaluation.rollouts import seeds_for
from ibe_rl.evaluation.runs import TrainedRun, load_run
from ibe_rl.ibe import IBEConfig
from ibe_rl.ibe.delay import caught_up
from ibe_rl.ibe.delta import cut_windows
from ibe_rl.ibe.find_delay import find_delay
from ibe_rl.ibe.word_meaning import expected_motion, top_words
from ibe_rl.instructors import make_instructor
from ibe_rl.instructors.flawed import FlawedConfig, corrupted
from ibe_rl.metrics.bootstrap import weighted_f1
from ibe_rl.metrics.quality import direction, motion_auc, phrases_of
from ibe_rl.storage.run_folder import read_json, write_json
from ibe_rl.task import Task
from ibe_rl.types import Array, Episode, ExpressionMapping
from ibe_rl.vocabulary.fitting import fit_mapping

console = Console(highlight=False)
STRIDE_STEPS, ENVS = 4, 50
RESULTS, PAGE = Path(__file__).parent / "words.json", DOCS / "WORDS.md"
FLAWS = {
    "": FlawedConfig(),
    "a fifth wrong": FlawedConfig(wrong=0.2),
    "late by 25": FlawedConfig(late_steps=25),
    "late by 25, a fifth wrong, half absent": FlawedConfig(late_steps=25, wrong=0.2, present=0.5),
}
Truth = Callable[[Array, Task], Array]
"""From real changes ``(N, S)`` to the slot of the word for them, ``(N,)``, by what the environment declares."""


def of_way(delta: Array, task: Task) -> Array:
    """Of three words: the way it really went."""
    [x], [band] = task.explained, task.explained_band
    return direction(delta[:, x], band) + 1


def of_way_swapped(delta: Array, task: Task) -> Array:
    """The same from one who uses the keys for left and right the other way round."""
    return 2 - of_way(delta, task)


def of_five(delta: Array, task: Task) -> Array:
    """Of five words: the change that is largest in its declared band, ``hold`` where none is beyond it."""
    aside, speed = (delta[:, list(task.explained)] / np.array(task.explained_band)).T
    moved = np.maximum(np.abs(aside), np.abs(speed)) > 1
    way = np.where(aside < 0, FALL_LEFT, FALL_RIGHT)
    faster = np.where(speed < 0, FASTER, SLOWER)
    return np.where(moved, np.where(np.abs(aside) >= np.abs(speed), way, faster), HOLD)


def swapped_keys(task: Task) -> Task:
    """The rule of one who says ``rechts`` where it should go to the left."""
    rule = task.rule
    return replace(task, rule=lambda states: rule(states)[..., [2, 1, 0]])


THREE = worded(LANDER_TASK, ["links", "halt", "rechts"])
LANGUAGES: dict[str, tuple[Task, Truth]] = {
    "three words": (THREE, of_way),
    "three words, keys swapped": (swapped_keys(THREE), of_way_swapped),
    "five words without an order": (worded(LANDER_WORDS_TASK, []), of_five),
}


def told(episodes: Sequence[Episode], task: Task, flaws: FlawedConfig, seed: int) -> list[Episode]:
    """The same episodes, told in words by the rule of ``task``."""
    assert task.words is not None
    given = [replace(one, instructions=task.rule(one.states[:-1]), given=np.ones(len(one), bool)) for one in episodes]
    return corrupted(given, task.instruction_values, flaws, seed, len(task.words.names))


def judged(mapping: ExpressionMapping, delta: Array, task: Task, truth: Truth) -> dict[str, Any]:
    """How well the words of a vocabulary fit real changes ``(N, S)``: a listener hears the word, and the movement."""
    said, real = mapping.express(delta), truth(delta, task)
    expected = expected_motion(mapping, said, task.explained)
    weights, slots = np.ones((1, len(delta))), len(task.phrases)
    numbers = zip(expected.T, delta[:, list(task.explained)].T, task.explained_band, strict=True)
    return {
        "f1": float(weighted_f1(top_words(said), real, slots, weights)[0]),
        "motion_auc": [motion_auc(one, change, band) for one, change, band in numbers],
        "phrases": len(set(phrases_of(said, task.phrases).tolist())),
    }


def real_changes(run: TrainedRun, episodes: int) -> Array:
    """Changes ``(N, S)`` of the state over the horizon, at moments of greedy episodes that are not in the log."""
    envs = [run.make_env() for _ in range(min(ENVS, episodes))]
    flown = play(
        envs, run.policy, make_instructor(InstructorConfig("oracle"), run.task), seeds_for("judged", 0, episodes)
    )
    windows = cut_windows(flown, run.horizon_steps, "clamp")
    return np.asarray(windows.delta[windows.step % STRIDE_STEPS == 0], float)


def measure(run: TrainedRun, real: Array, language: str, flaw: str, seed: int) -> dict[str, Any]:
    """One language and flaw on the log of one run."""
    refits, (task, truth), flaws = Refits(run, seed), LANGUAGES[language], FLAWS[flaw]
    paper: MappingConfig = IBEConfig(horizon_steps=run.horizon_steps)
    row: dict[str, Any] = {"language": language, "flaw": flaw}
    for name, config in {"ours": run.config.mapping, "paper": paper}.items():
        lessons = refits.lessons(config)
        best, heard = (told(part, task, flaws, seed) for part in (lessons.best, lessons.heard))
        if name == "ours":
            delay = find_delay(heard)
            row["delay_steps"] = delay.steps
            best, heard = caught_up(best, delay), caught_up(heard, delay)
        mapping = fit_mapping(best, heard, config, task, seed, horizon_steps=run.horizon_steps)
        row[name] = judged(mapping, real, task, truth)
    return row


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Means over the runs, and the least of them."""
    lines = [
        "| words | flaw | told apart (macro-F1) | the paper's | motion AUC | the paper's | delay found |",
        "|---|---|---|---|---|---|---|",
    ]
    for language in LANGUAGES:
        for flaw in FLAWS:
            here = [row for row in rows if (row["language"], row["flaw"]) == (language, flaw)]
            if not here:
                continue
            ours, paper = ([row[name] for row in here] for name in ("ours", "paper"))
            cells = [_least([one["f1"] for one in ours]), _least([one["f1"] for one in paper])]
            cells += [_aucs(ours), _aucs(paper), ", ".join(str(row["delay_steps"]) for row in here)]
            lines.append(f"| {language} | {flaw or 'none'} | {' | '.join(cells)} |")
    return lines


def _least(values: Sequence[float]) -> str:
    return f"{np.mean(values):.3f} (least {min(values):.3f})"


def _aucs(each: Sequence[dict[str, Any]]) -> str:
    return ", ".join(f"{value:.3f}" for value in np.mean([one["motion_auc"] for one in each], axis=0))


def main(arguments: list[str] | None = None) -> None:
    """Measure, and put the table into docs/WORDS.md, or alone into the folder that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.words", description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN", help="folders of lander runs")
    parser.add_argument("--missing", action="store_true", help="only what was not measured of these runs")
    parser.add_argument("--report", action="store_true", help="only the table of the last measurement")
    parser.add_argument("--episodes", type=int, default=100, help="greedy episodes to judge on")
    parser.add_argument("--output", type=Path, help="a folder for what is written, instead of the repository's")
    asked = parser.parse_args(arguments)
    if bool(asked.runs) == asked.report:
        parser.error("RUN: allowed are one or more, or --report without any")
    results = asked.output / RESULTS.name if asked.output else RESULTS
    if asked.report and not results.exists():
        parser.error(f"--report: allowed once something was measured ({results} is not there)")
    rows = read_json(results)["rows"] if asked.report or (asked.missing and results.exists()) else []
    if not asked.report:
        results.parent.mkdir(parents=True, exist_ok=True)
        rows = measure_all(rows, asked.runs, asked.episodes, results)
    fill(asked.output / PAGE.name if asked.output else PAGE, {"words": table(rows)}, "benchmarks.words")


def measure_all(before: Sequence[dict[str, Any]], folders: Sequence[Path], episodes: int, results: Path) -> list[Any]:
    """The rows of all runs, written after each of them; those of ``before`` are not measured again."""
    names = [f"{training_of(folder)}, {episodes} episodes" for folder in folders]
    rows = [row for row in before if row["run"] in names]
    known = {(row["run"], row["language"], row["flaw"]) for row in rows}
    for seed, (name, folder) in enumerate(zip(names, folders, strict=True)):
        lacking = [(one, flaw) for flaw, one in product(FLAWS, LANGUAGES) if (name, one, flaw) not in known]
        if not lacking:
            continue
        run = load_run(folder)
        real = real_changes(run, episodes)
        for language, flaw in lacking:
            row = {"run": name, **measure(run, real, language, flaw, seed)}
            console.print(row)
            rows = sorted([*rows, row], key=lambda one: names.index(one["run"]))
            write_json(results, {"rows": rows})
    write_json(results, {"rows": rows})  # without runs that are not asked for, also where nothing lacked
    return rows


if __name__ == "__main__":
    main()
