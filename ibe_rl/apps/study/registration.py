"""A registration of a study, filled in from study.yaml: to be read, completed and deposited before people take part."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ibe_rl.apps.study.arm_names import ARM_NAMES
from ibe_rl.apps.study.comparisons import ANALYSIS, POWER, WANTED, comparisons
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.schedule import episodes_needed
from ibe_rl.apps.study.settings import LANDING, StudySettings
from ibe_rl.storage.run_folder import read_json, write_atomically

REGISTRATION = "registration.md"
_TODO = "**To be filled in:**"


def write_registration(folder: Path) -> Path:
    """Write the registration of a study; returns its path.

    Args:
        folder: of the study. With ``analysis/power.json`` the simulated power is stated too.

    Raises:
        ConfigError: as ``open_study``.
    """
    study = open_study(folder)
    path = study.folder / ANALYSIS / POWER
    text = registration(study, read_json(path) if path.exists() else None)
    where = study.folder / REGISTRATION
    write_atomically(where, lambda stream: stream.write(text.encode()))
    return where


def registration(study: Study, power: dict[str, Any] | None) -> str:
    """The text in Markdown.

    Args:
        study: opened.
        power: what power.json holds; None if it was not simulated.
    """
    settings = study.settings
    sections = {
        "Hypotheses": _list(settings.hypotheses) or f"{_TODO} `hypotheses` in study.yaml.",
        "Design": _design(study),
        "People": _people(settings, power),
        "Measures": _measures(settings),
        "Exclusions": _exclusions(settings),
        "The registered test": _test(settings),
        "What is reported beside it": _beside(settings),
        "What exists already": f"{_TODO} whether anybody has taken part, and who has seen their answers.",
    }
    head = (
        f"# Registration: {settings.title}\n\nProtocol `{study.protocol}`: a hash of study.yaml, texts and episodes.\n"
    )
    return head + "".join(f"\n## {title}\n\n{text}\n" for title, text in sections.items())


def _list(lines: list[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _design(study: Study) -> str:
    settings, trials = study.settings, study.settings.trials
    lines = [f"`{arm}`: {ARM_NAMES[arm]}" for arm in settings.arms]
    seen = episodes_needed(settings, len(study.orders[0]))
    return (
        f"Arms, design `{settings.design}`, given out evenly over people who have finished or are under way:\n\n"
        f"{_list(lines)}\n\nA person sees {seen} of {len(study.stimuli)} episodes, none twice: {trials.practice} for "
        f"practice, {trials.each_arm} in each block of an arm, {trials.transfer} afterwards without explanations. "
        f"Feedback, what really came: {trials.feedback}. The seed of orders is {settings.seed}."
    )


def _people(settings: StudySettings, power: dict[str, Any] | None) -> str:
    lines = [
        f"{settings.quota} people who finish, all arms together. Recruited through: {settings.recruiter}. "
        f"Recruiting stops at this number; nobody looks at the results before."
    ]
    for row in power["rows"] if power else []:
        first, second = (ARM_NAMES[arm] for arm in row["arms"])
        most = f"more than {row['people'][-1]}"
        lines.append(
            f"- {first} against {second}: {row['needed'] or most} people for a power of {WANTED:.0%}, by "
            f"{power['studies'] if power else 0} simulated studies with this analysis and simulated people."
        )
    if not power:
        lines.append(f"{_TODO} the power; `study power` simulates it.")
    return "\n\n".join(lines[:1]) + "\n\n" + "\n".join(lines[1:])


def _measures(settings: StudySettings) -> str:
    task = settings.trials.task
    if task == LANDING:
        measure = (
            "the distance of the place that a person points at from the true one, in percent of the picture's width"
        )
    else:
        measure = "whether a person's choice is right; the share of wrong choices in percent"
    lines = [f"Primary, task `{task}`: {measure}. Each person's mean over the trials of a block counts."]
    lines += ["Confidence from 0 to 100 after each trial."] if settings.trials.confidence else []
    lines += [f"Scale: {name}." for name in settings.scales]
    return _list(lines)


def _exclusions(settings: StudySettings) -> str:
    rules = settings.exclusions
    lines = [
        "who withdraws (the answers are deleted), or does not agree to take part",
        f"who fails the comprehension check {settings.comprehension_attempts} times (does not begin the trials)",
        *(["who does not finish"] if rules.unfinished else []),
        f"who fails more than {rules.failed_attention_checks} of {settings.trials.attention_checks} attention checks",
        f"whose median time of an answer is below {rules.median_answer_s:g} s",
    ]
    return f"Not counted are people, in this order of rules:\n\n{_list(lines)}\n\nNo single answer is left out."


def _test(settings: StudySettings) -> str:
    first, second = settings.test.arms
    return (
        f"`{first}` against `{second}`: a two-sided permutation test over people on the difference of person means, "
        f"{settings.test.resamples} resamples, alpha = {settings.test.alpha:g}. Where each person has both arms, the "
        "sign of each person's difference is flipped; otherwise arms are shuffled between people. From each answer the "
        "mean of its episode over both arms is taken away. The 95 % interval draws people and episodes again, each by "
        f"itself. It is expected that people err less with `{first}`."
    )


def _beside(settings: StudySettings) -> str:
    others = [f"`{first}` against `{second}`" for first, second in comparisons(settings)[1:]]
    lines = [f"Other comparisons, p corrected together: {', '.join(others)}."] if others else []
    lines += [
        "A mixed model with people and episodes as crossed random effects.",
        "Effect sizes, calibration of confidence, change over the trials, transfer, reliability and means of scales.",
    ]
    return f"Exploratory:\n\n{_list(lines)}"
