"""Let a trained agent explain an episode step by step, or judge its explanations.

python explain.py                                the newest run below runs/
python explain.py run=runs/NAME seed=3 context=left
python explain.py run=runs/NAME viewer=live      and view it in the browser
python explain.py run=runs/NAME clip=FILE.gif    and write it as a moving picture (or .mp4)
python explain.py run=runs/NAME task=evaluate    is it true? tables, figures, evaluation/quality.json
python explain.py run=runs/NAME task=compare     would another kind of vocabulary be truer?
python explain.py run=runs/NAME task=summary     what it does as a whole, in its words: summary/report.html
python explain.py run=runs/NAME task=predictors  as true without a simulator? evaluation/predictors.json
python explain.py run=runs/NAME task=figures     the paper's experiments with its agents: figures/report.html
python explain.py agent=model.zip env=lander     an external agent: roll out, learn a vocabulary, explain
python explain.py sweep=runs/NAME                the runs of a sweep by condition: figures/report.html
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import torch

from ibe_rl.config.command_line import run_script
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.compare import compare
from ibe_rl.evaluation.evaluate import evaluate
from ibe_rl.evaluation.narration import check_episode, clip_of, explain_rollout, print_narration
from ibe_rl.evaluation.predictors import judge_predictors
from ibe_rl.evaluation.run_predictor import as_trained
from ibe_rl.evaluation.runs import open_trained, refuse_external_settings
from ibe_rl.evaluation.task_settings import refuse_unread
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.metrics.quality import outcomes
from ibe_rl.runtime.apps import load_app
from ibe_rl.runtime.installation import opened_with
from ibe_rl.storage.whole_folder import whole_file
from ibe_rl.task import RecordedRollout
from ibe_rl.types import Explanation
from ibe_rl.view.address import Ports, choose_ports
from ibe_rl.view.recorder import Recorder
from ibe_rl.view.relay import Relay, wants_browser


def main(cfg: ExplainConfig) -> None:
    """Open the run and do its ``task``, or report a sweep."""
    refuse_unread(cfg)
    if cfg.sweep_dir is not None:
        load_app("sweep=")(cfg)
        return
    if cfg.agent_file is not None:
        run = load_app("agent=")(cfg)
    else:
        refuse_external_settings(cfg)
        run = open_trained(cfg.run)
    tasks = {"episode": explain_episode, "evaluate": evaluate, "compare": compare, "predictors": judge_predictors}
    (tasks.get(cfg.task) or load_app(f"task={cfg.task}"))(run, as_trained(cfg, run))


def explain_episode(run: TrainedRun, cfg: ExplainConfig) -> None:
    """Explain one episode in the terminal and in a recording."""
    torch.set_num_threads(1)
    check_episode(cfg, run)
    ports = choose_ports(cfg.viewer.grpc_port, cfg.viewer.web_port) if cfg.viewer.mode == "live" else None
    rollout, said = explain_rollout(run, cfg)
    print_narration(run, rollout, said)
    if cfg.clip:
        print(f"clip: {clip_of(run, rollout, said, Path(cfg.clip))}")
    if cfg.viewer.mode == "off":
        return
    recording = record(run, cfg, rollout, said)
    print(f"recording: {recording}\n  open it with: {opened_with('rerun', recording)}")
    if ports:
        serve_until_enter(recording, ports, wants_browser(cfg.viewer.open))


def record(run: TrainedRun, cfg: ExplainConfig, rollout: RecordedRollout, said: Sequence[Explanation]) -> Path:
    """Write the recording of the episode; returns its path."""
    name = f"episode_seed{cfg.seed}_{rollout.episode.context}"
    path = Path(cfg.output) if cfg.output else run.folder / "explanations" / f"{name}.rrd"
    real = outcomes(rollout.episode, run.horizon_steps, run.mapping, run.task.phrases)
    with whole_file(path, "output") as partial, closing(Recorder(partial, run.task, name, training=False)) as recorder:
        recorder.watched(run.policy_frame, rollout, said, real)
    return path


def serve_until_enter(recording: Path, ports: Ports, browser: bool) -> None:
    """Serve the recording until Enter or Ctrl-C; not served without a terminal, which could not end it."""
    if not sys.stdin.isatty():
        print("not served: there is no terminal from which to stop it")
        return
    with Relay(recording, ports, browser) as relay:
        print(*relay.wait(), sep="\n")
        input("  press Enter to stop ")


if __name__ == "__main__":
    run_script(main, Path(__file__).parent / "configs", "explain")
