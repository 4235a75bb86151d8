"""``task=summary``: what an agent does as a whole, in its words: one page, one JSON file, for any environment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ibe_rl.apps.summary.disobeying import where_not_as_told
from ibe_rl.apps.summary.episode_in_words import PlayedEpisode
from ibe_rl.apps.summary.page import write_summary_page
from ibe_rl.apps.summary.played import put_steps_in_words
from ibe_rl.apps.summary.printing import print_summary
from ibe_rl.apps.summary.shares import shares_by_context_and_phase
from ibe_rl.apps.summary.side_by_side import RolledAgent, beside
from ibe_rl.apps.summary.steps import step_table
from ibe_rl.apps.summary.telling import telling_episodes
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.narration import explain_rollout_by
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.report import make_folders
from ibe_rl.evaluation.rollouts import seeds_for
from ibe_rl.evaluation.run_predictor import as_trained, shared_predictor
from ibe_rl.evaluation.runs import earlier_state, open_trained
from ibe_rl.evaluation.trained_run import TrainedRun, instructed_by
from ibe_rl.storage.run_folder import POLICY_SUMMARY, write_json
from ibe_rl.types import ConfigError
from ibe_rl.view.wording import shortener


def sum_up(run: TrainedRun, cfg: ExplainConfig) -> None:
    """Play held-out episodes, tell what the agent does in them, and write and print it.

    Raises:
        ConfigError: before any episode, if the agent beside it cannot be opened or does another task.
    """
    other = agent_beside(run, cfg)
    make_folders(run.folder, (POLICY_SUMMARY,))
    ours = rolled_out(run, cfg)
    theirs = None if other is None else rolled_out(other, as_trained(cfg, other))
    found = summary_of(run, cfg, ours) | {"beside": None}
    if other is not None and theirs is not None:
        found["beside"] = {"other": about_agent(other), **beside(ours, theirs, run.task.judges_success)}
    path = run.folder / POLICY_SUMMARY / "summary.json"
    write_json(path, found)
    page = write_summary_page(path.parent, found, ours[0], theirs[0] if theirs else [], run.task)
    print_summary(found, path, page, shortener(run.task.phrases))


def agent_beside(run: TrainedRun, cfg: ExplainConfig) -> TrainedRun | None:
    """The agent that is set beside the run: another run, or an earlier state of this or the other one.

    Raises:
        ConfigError: if it does another task, or is the agent itself.
    """
    if cfg.with_run is None and cfg.with_frame is None:
        return None
    other = run if cfg.with_run is None else open_trained(cfg.with_run)
    mine, theirs = (one.task.name for one in (run, other))
    if (run.config.env.id, mine) != (other.config.env.id, theirs):
        raise ConfigError(f"with={cfg.with_run}: it is of {theirs}; allowed is a run of {mine}")
    other = other if cfg.with_frame is None else earlier_state(other, cfg.with_frame)
    if (other.folder.resolve(), other.policy_frame) == (run.folder.resolve(), run.policy_frame):
        named = f"with={cfg.with_run}" if cfg.with_frame is None else f"with_frame={cfg.with_frame}"
        raise ConfigError(
            f"{named}: that is the agent itself, its policy of frame {run.policy_frame:,}; allowed is another run, "
            "or a training frame near which it kept another policy"
        )
    return other


def rolled_out(run: TrainedRun, cfg: ExplainConfig) -> RolledAgent:
    """Episodes of an agent, and their steps."""
    played = play_episodes(run, cfg)
    return played, step_table(played, cfg.summary.resamples, cfg.summary.seed)


def play_episodes(run: TrainedRun, cfg: ExplainConfig) -> list[PlayedEpisode]:
    """Play the episodes of a summary and explain every step of them as it is spoken."""
    seeds = seeds_for("summed", cfg.summary.seed, cfg.summary.episodes)
    played = []
    with (
        shared_predictor(run, cfg, cfg.summary.seed) as predictor,
        progress_bar(f"episodes, step by step: frame {run.policy_frame:,}", len(seeds)) as advance,
    ):
        for seed in seeds:
            watched, said = explain_rollout_by(predictor, run, replace(cfg, seed=seed, what_if=False))
            played.append(put_steps_in_words(run, seed, watched, said))
            advance()
    return played


def summary_of(run: TrainedRun, cfg: ExplainConfig, rolled: RolledAgent) -> dict[str, Any]:
    """What summary.json holds of one agent."""
    played, steps = rolled
    judged = run.task.judges_success
    return {
        "protocol": protocol(run, cfg, played),
        "shares": shares_by_context_and_phase(steps, run.task.contexts),
        "not_as_told": where_not_as_told(steps, played),
        "telling_episodes": telling_episodes(played, judged, cfg.summary.films),
        "episodes": [episode_row(one, judged) for one in played],
    }


def protocol(run: TrainedRun, cfg: ExplainConfig, played: Sequence[PlayedEpisode]) -> dict[str, Any]:
    """How the summary was made."""
    return {
        **about_agent(run),
        "environment": run.task.name,
        "contexts": list(run.task.contexts),
        "episodes": len(played),
        "steps": sum(map(len, played)),
        "seeds": [played[0].seed, played[-1].seed],
        "predictor": cfg.predictor.kind,
        "futures": cfg.predictor.futures,
        "min_confidence": cfg.min_confidence,
        "resamples": cfg.summary.resamples,
        "seed": cfg.summary.seed,
        "instructed_by": instructed_by(run),
    }


def about_agent(run: TrainedRun) -> dict[str, Any]:
    """Which agent it is."""
    return {
        "run": run.folder.resolve().name,
        "folder": str(run.folder),
        "policy_frame": run.policy_frame,
        "mapping_frame": run.mapping_frame,
        "horizon_steps": run.horizon_steps,
    }


def episode_row(one: PlayedEpisode, judges_success: bool) -> dict[str, Any]:
    """An episode in a line of summary.json."""
    return {
        "seed": one.seed,
        "context": one.episode.context,
        "steps": len(one),
        "return": round(one.episode.total_reward, 5),
        "success": bool(one.episode.success) if judges_success else None,
    }
