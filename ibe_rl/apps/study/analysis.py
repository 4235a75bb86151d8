"""The analysis of a study in one command: tables, the registered test, and a page with all that is beside it."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ibe_rl.apps.study import measures
from ibe_rl.apps.study.analysis_page import write_analysis_page
from ibe_rl.apps.study.answers import FILE, Answer, Answers, Person
from ibe_rl.apps.study.codebook import data_file, write_dataset, write_texts
from ibe_rl.apps.study.columns import THEN, counted
from ibe_rl.apps.study.comparisons import ANALYSIS, comparisons, reference_of
from ibe_rl.apps.study.data import StudyData, answers_given, free_texts, tables_of
from ibe_rl.apps.study.exclusions import exclusion_counts, reasons
from ibe_rl.apps.study.findings import outcome
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.models import linear_model, r_script
from ibe_rl.apps.study.registered import compared
from ibe_rl.metrics.effect import corrected
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.storage.run_folder import write_atomically, write_json
from ibe_rl.types import ConfigError

RESULTS, FREE_TEXTS, R_FILE = "results.json", "free_texts.csv", "model.R"
Sittings = Sequence[tuple[Person, Sequence[Answer]]]


def analyse(folder: Path, seed: int = 0) -> None:
    """Analyse a study; print what came out and where the files are.

    Real participants count. As long as there are none, the pilots do, and everything says so.

    Args:
        folder: of the study; the files go to ``analysis/`` in it.
        seed: of shuffles and resamples.

    Raises:
        ConfigError: if nobody has taken part, or the study was changed since; and as ``open_study``.
    """
    study = open_study(folder)
    given, pilot = sittings(study)
    data = tables_of(study, given)
    found = findings(study, data, pilot, seed)
    where = study.folder / ANALYSIS
    where.mkdir(exist_ok=True)
    name = study.folder.resolve().name
    people = data.people.assign(excluded=reasons(data.people, study.settings))
    tables = {"trials": data.trials, "items": data.items, "people": people}
    write_dataset(where, name, study.settings.title, pilot, tables)
    write_texts(where / FREE_TEXTS, free_texts(study, given))
    script = r_script(found["choices"], found["reference"], data_file(name, "trials"), data_file(name, "people"))
    write_atomically(where / R_FILE, lambda stream: stream.write(script.encode()))
    write_json(where / RESULTS, found)
    page = write_analysis_page(where, found, script)
    console = PlainConsole(soft_wrap=True)
    for line in outcome(found):
        console.print(line)
    console.print(f"report: {page}")


def sittings(study: Study) -> tuple[Sittings, bool]:
    """All people who take part, with their answers; the pilots, and True, as long as there are no real ones.

    Raises:
        ConfigError: if there are none, or the study was changed after they had begun.
    """
    path = study.folder / FILE
    if not path.exists():
        raise _nobody(study)
    with contextlib.closing(Answers(path)) as answers:
        people, pilots = ([*answers_given(answers, pilots)] for pilots in (False, True))
    pilot = not people
    given = people or pilots
    if not given:
        raise _nobody(study)
    same = [(person, said) for person, said in given if person.protocol == study.protocol]
    if not same or (not pilot and len(same) < len(given)):
        raise ConfigError(
            f"study={study.folder}: {len(given) - len(same)} of {len(given)} people answered another version of it; "
            "allowed is the folder as it was when they began"
        )
    return same, pilot


def _nobody(study: Study) -> ConfigError:
    return ConfigError(
        f"study={study.folder}: nobody has taken part yet; allowed is a study with answers, those of pilots too"
    )


def findings(study: Study, data: StudyData, pilot: bool, seed: int = 0) -> dict[str, Any]:
    """All numbers of the report, for JSON: those of the registered test first."""
    settings = study.settings
    resamples, arms = settings.test.resamples, settings.arms
    excluded = reasons(data.people, settings)
    kept = data.people[excluded == ""]
    trials = data.trials[data.trials["person"].isin(kept["person"])]
    items = data.items[data.items["person"].isin(kept["person"])]
    some, pair = counted(trials), (settings.test.arms[0], settings.test.arms[1])
    pairs, reference = comparisons(settings), reference_of(settings)
    of_episodes = measures.episodes(study, some, arms, pair)
    return {
        "title": settings.title,
        "study": study.folder.resolve().name,
        "protocol": study.protocol,
        "pilot": pilot,
        "design": settings.design,
        "task": settings.trials.task,
        "choices": bool(some["correct"].notna().any()),
        "arms": list(arms),
        "reference": reference,
        "hypotheses": list(settings.hypotheses),
        "people": {"begun": len(data.people), "counted": len(kept), "by_arms": _by_arms(kept, arms)},
        "excluded": exclusion_counts(excluded),
        "trials": len(some),
        "resamples": resamples,
        "registered": {**compared(some, pair, resamples, seed), "alpha": settings.test.alpha},
        "others": _others(some, pairs[1:], resamples, seed),
        "model": linear_model(some, arms, reference),
        "means": measures.arm_means(some, arms, resamples, seed),
        "observers": measures.observer_means(of_episodes, arms),
        "episodes": of_episodes,
        "calibration": _calibrations(some, arms, resamples, seed),
        "learning": measures.learning(some, arms, resamples, seed),
        "transfer": measures.transfer(trials, pair, resamples, seed),
        "scales": measures.scales(items, arms, resamples, seed),
        "demographics": measures.demographics(study, items),
    }


def _by_arms(people: pd.DataFrame, arms: Sequence[str]) -> dict[str, int]:
    """How many people had which arms, in whatever order."""
    had = people["arms"].map(lambda each: " and ".join(arm for arm in arms if arm in each.split(THEN)))
    return {str(name): int(count) for name, count in had.value_counts(sort=False).sort_index().items()}


def _others(trials: pd.DataFrame, pairs: Sequence[tuple[str, str]], resamples: int, seed: int) -> list[dict[str, Any]]:
    """Comparisons that are not registered, their p corrected for all of them."""
    found = [compared(trials, pair, resamples, seed) for pair in pairs]
    known = [one for one in found if one["p"] is not None]
    for one, p in zip(known, corrected([one["p"] for one in known]), strict=True):
        one["p"] = p
    return found


def _calibrations(trials: pd.DataFrame, arms: Sequence[str], resamples: int, seed: int) -> dict[str, Any]:
    rows = min(resamples, 2_000)
    by_arm = {arm: measures.calibration(trials[trials["arm"] == arm], rows, seed) for arm in arms}
    return {arm: one for arm, one in by_arm.items() if one}
