"""Let a trained agent explain itself: fly one episode and say, step by step, what it is about to do.

Or ask whether what it says is true.

python explain.py                                the newest run below runs/
python explain.py run=runs/NAME seed=3 context=left
python explain.py run=runs/NAME viewer=live      and look at it in the browser
python explain.py run=runs/NAME task=evaluate    is it true? tables, figures, evaluation/quality.json
python explain.py run=runs/NAME task=compare     would another kind of vocabulary be truer?
python explain.py run=runs/NAME task=predictors  as true without a simulator? evaluation/predictors.json
python explain.py run=runs/NAME task=figures     the paper's experiments with its agents: figures/report.html
python explain.py sweep=runs/NAME                what the runs of a sweep learnt, by what differs: figures/report.html
python explain.py sweep=runs/NAME viewer=live    and all their recordings in the browser
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import torch
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from ibe_rl.command_line import installed, run_script
from ibe_rl.config import ExplainConfig
from ibe_rl.data import ConfigError, Explanation
from ibe_rl.evaluation import TrainedRun, load_run
from ibe_rl.evaluation.compare import compare
from ibe_rl.evaluation.evaluate import evaluate
from ibe_rl.evaluation.foresight import predictor_of
from ibe_rl.evaluation.predictors import judge_predictors
from ibe_rl.explainer import explain
from ibe_rl.ibe import phrase
from ibe_rl.instruct import make_instructor, stand_in
from ibe_rl.metrics import happened, phrases_true
from ibe_rl.paper.experiments import reproduce
from ibe_rl.play import watch
from ibe_rl.run_folder import find_run
from ibe_rl.scene import Watched
from ibe_rl.serve.relay import Ports, Relay, choose_ports, invitation
from ibe_rl.stream import SILENCE, Recorder, short
from ibe_rl.sweep.report import report
from ibe_rl.task import Task
from ibe_rl.viewer import main as show

NOT_TRUSTED = "(?)"


def main(cfg: ExplainConfig) -> None:
    """Do what ``task`` names, or report a sweep."""
    if cfg.sweep_dir is not None:
        report_sweep(cfg)
        return
    tasks = {"evaluate": evaluate, "compare": compare, "predictors": judge_predictors, "figures": reproduce}
    tasks.get(cfg.task, explain_episode)(cfg)


def report_sweep(cfg: ExplainConfig) -> None:
    """Put the runs of a sweep together; with ``viewer=live`` open all their recordings too."""
    if cfg.run is not None or cfg.task != "episode":
        raise ConfigError(f"sweep={cfg.sweep_dir} reports a whole sweep; allowed is neither run= nor task= beside it")
    ports = choose_ports(cfg.viewer.grpc_port, cfg.viewer.web_port) if cfg.viewer.mode == "live" else None
    report(Path(str(cfg.sweep_dir)))
    if ports:
        show([str(cfg.sweep_dir), "--grpc-port", str(ports.grpc), "--web-port", str(ports.web)])


def explain_episode(cfg: ExplainConfig) -> None:
    """Explain one episode in the terminal and in a recording."""
    torch.set_num_threads(1)
    run = load_run(find_run(cfg.run, Path("runs")))
    allowed = run.task.contexts
    if cfg.context is not None and cfg.context not in allowed:
        raise ConfigError(f"context={cfg.context}: allowed is one of {', '.join(allowed)}, or none to draw one")
    ports = choose_ports(cfg.viewer.grpc_port, cfg.viewer.web_port) if cfg.viewer.mode == "live" else None
    watched, said = fly(run, cfg)
    tell(run, watched, said)
    if cfg.viewer.mode == "off":
        return
    recording = record(run, cfg, watched, said)
    print(f"recording: {recording}\n  open it with: {installed('rerun')} {recording}")
    if ports:
        serve_while_looked_at(recording, ports)


def fly(run: TrainedRun, cfg: ExplainConfig) -> tuple[Watched, list[Explanation]]:
    """Fly the episode, then explain its every step."""
    instructor = make_instructor(stand_in(run.config.instructor), run.task)
    watched = watch(run.make_env(), run.policy, instructor, cfg.seed, cfg.context)
    voice = replace(run.voice, futures=cfg.predictor.futures, min_confidence=cfg.min_confidence)
    with predictor_of(run, cfg.predictor, cfg.seed) as predictor:
        said = explain(watched.moments, run.policy, predictor, voice)
    return watched, said


def tell(run: TrainedRun, watched: Watched, said: Sequence[Explanation]) -> None:
    """Print what was said, one row for each stretch of steps with the same words."""
    episode, words = watched.episode, run.task.phrases
    told = [
        short([phrase(moment.instruction, words)], words)[0] if moment.given else SILENCE for moment in watched.moments
    ]
    true = phrases_true(episode, said, run.mapping, words)
    outcome = "success" if episode.success else "no success"
    table = Table(box=SIMPLE, title_justify="left", show_edge=False)
    table.title = (
        f"{run.task.name}: {episode.context}, {len(episode)} steps, {outcome}, return {episode.total_reward:.1f}"
    )
    ahead = [f"next {one.horizon_steps} steps" for one in said[0].all_spans]
    for column in ("steps", "is told", *ahead, "number", "sure", "true"):
        table.add_column(column, no_wrap=column not in ahead, justify="right" if column == "steps" else "left")
    spoken = [spoken_of(each, run.task) for each in said]
    for (instruction, heard), group in groupby(range(len(said)), key=lambda step: (told[step], spoken[step])):
        steps = list(group)
        expressions = np.array([said[step].expression for step in steps])
        numbers = " ".join(f"{value:+.2f}" for value in expressions.mean(axis=0))
        confidence = np.mean([said[step].confidence for step in steps])
        span = str(steps[0]) if len(steps) == 1 else f"{steps[0]}-{steps[-1]}"
        table.add_row(span, instruction, *heard, numbers, f"{confidence:.0%}", f"{np.mean(true[steps]):.0%}")
    console = Console(highlight=False)
    console.width = max(console.width, 110)
    console.print(table)
    console.print(
        f"{np.mean(true):.0%} of what it said about its next {run.horizon_steps} steps came true. "
        f"Policy of frame {run.policy_frame:,}, vocabulary of frame {run.mapping_frame:,}."
    )
    if not all(span.trusted for one in said for span in one.all_spans):
        console.print(f"{NOT_TRUSTED}: its predictor does not stand by a path that long.")


def spoken_of(said: Explanation, task: Task) -> list[str]:
    """What is said of each span of time, with a mark where the predictor does not stand by it to the end."""
    spans = said.all_spans
    words = short([one.said for one in spans], task.phrases)
    return [text if one.trusted else f"{text} {NOT_TRUSTED}" for text, one in zip(words, spans, strict=True)]


def record(run: TrainedRun, cfg: ExplainConfig, watched: Watched, said: Sequence[Explanation]) -> Path:
    """Write the recording of the episode; returns where."""
    name = f"episode_seed{cfg.seed}_{watched.episode.context}"
    path = Path(cfg.output) if cfg.output else run.folder / "explanations" / f"{name}.rrd"
    real = happened(watched.episode, run.horizon_steps, run.mapping, run.task.phrases)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with closing(Recorder(path, run.task, name, training=False)) as recorder:
            recorder.watched(run.policy_frame, watched, said, real)
    except OSError as error:
        raise ConfigError(f"output={path}: allowed is a file that can be written ({error.strerror})") from None
    return path


def serve_while_looked_at(recording: Path, ports: Ports) -> None:
    """Serve the recording until Enter or Ctrl-C; without a terminal nobody could end it, so it is not served."""
    if not sys.stdin.isatty():
        print("not served: there is no terminal to end it from")
        return
    with Relay(recording, ports):
        print(invitation(ports))
        input("  Enter ends it ")


if __name__ == "__main__":
    run_script(main, Path(__file__).parent / "configs", "explain")
