"""Let a trained agent explain itself: fly one episode and say, step by step, what it is about to do.

Or ask whether what it says is true.

python explain.py                                the newest run below runs/
python explain.py run=runs/NAME seed=3 context=left
python explain.py run=runs/NAME viewer=live      and look at it in the browser
python explain.py run=runs/NAME task=evaluate    is it true? tables, figures, evaluation/quality.json
python explain.py run=runs/NAME task=compare     would another kind of vocabulary be truer?
python explain.py run=runs/NAME task=predictors  as true without a simulator? evaluation/predictors.json
python explain.py run=runs/NAME task=figures     the paper's experiments with its agents: figures/report.html
python explain.py agent=model.zip env=lander     an agent trained elsewhere: play, learn the words, explain
python explain.py sweep=runs/NAME                what the runs of a sweep learnt, by what differs: figures/report.html
python explain.py sweep=runs/NAME viewer=live    and all their recordings in the browser
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import torch

from ibe_rl.apps.external.study import open_guest, refuse_guest_settings
from ibe_rl.apps.paper.experiments import reproduce
from ibe_rl.apps.sweep.report import report
from ibe_rl.config.command_line import installed, run_script
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation import TrainedRun, load_run
from ibe_rl.evaluation.compare import compare
from ibe_rl.evaluation.evaluate import evaluate
from ibe_rl.evaluation.narration import check_context, fly, tell
from ibe_rl.evaluation.predictors import judge_predictors
from ibe_rl.evaluation.run_predictor import as_trained
from ibe_rl.metrics import outcomes
from ibe_rl.storage.run_folder import find_run
from ibe_rl.task import Watched
from ibe_rl.types import ConfigError, Explanation
from ibe_rl.view.recorder import Recorder
from ibe_rl.view.relay import Ports, Relay, choose_ports, invitation
from ibe_rl.view.viewer import main as show


def main(cfg: ExplainConfig) -> None:
    """Do what ``task`` names, or report a sweep."""
    if cfg.sweep_dir is not None:
        report_sweep(cfg)
        return
    cfg = as_trained(cfg)
    if cfg.agent_file is not None:
        opened = open_guest(cfg)
        {"episode": explain_episode, "evaluate": evaluate, "compare": compare}[cfg.task](cfg, opened)
        return
    refuse_guest_settings(cfg)
    tasks = {"evaluate": evaluate, "compare": compare, "predictors": judge_predictors, "figures": reproduce}
    tasks.get(cfg.task, explain_episode)(cfg)


def report_sweep(cfg: ExplainConfig) -> None:
    """Put the runs of a sweep together; with ``viewer=live`` open all their recordings too."""
    if cfg.run is not None or cfg.agent_file is not None or cfg.task != "episode":
        raise ConfigError(f"sweep={cfg.sweep_dir} reports a whole sweep; allowed is no run=, agent= or task= beside it")
    ports = choose_ports(cfg.viewer.grpc_port, cfg.viewer.web_port) if cfg.viewer.mode == "live" else None
    report(Path(str(cfg.sweep_dir)))
    if ports:
        show([str(cfg.sweep_dir), "--grpc-port", str(ports.grpc), "--web-port", str(ports.web)])


def explain_episode(cfg: ExplainConfig, opened: TrainedRun | None = None) -> None:
    """Explain one episode, of the run that is ``opened`` already or else named, in the terminal and in a recording."""
    torch.set_num_threads(1)
    run = opened or load_run(find_run(cfg.run, Path("runs")))
    check_context(cfg.context, run)
    ports = choose_ports(cfg.viewer.grpc_port, cfg.viewer.web_port) if cfg.viewer.mode == "live" else None
    watched, said = fly(run, cfg)
    tell(run, watched, said)
    if cfg.viewer.mode == "off":
        return
    recording = record(run, cfg, watched, said)
    print(f"recording: {recording}\n  open it with: {installed('rerun')} {recording}")
    if ports:
        serve_while_looked_at(recording, ports)


def record(run: TrainedRun, cfg: ExplainConfig, watched: Watched, said: Sequence[Explanation]) -> Path:
    """Write the recording of the episode; returns where."""
    name = f"episode_seed{cfg.seed}_{watched.episode.context}"
    path = Path(cfg.output) if cfg.output else run.folder / "explanations" / f"{name}.rrd"
    real = outcomes(watched.episode, run.horizon_steps, run.mapping, run.task.phrases)
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
