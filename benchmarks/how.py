"""How each figure is measured, in a sentence or two, for docs/BENCHMARKS.md."""

from __future__ import annotations

from benchmarks.plan import LEVELS, REWARDED, Sizes

ALGORITHMS = {"ppo": "PPO", "dqn": "DQN"}
WORST = "The worst seed of each side, which need not be the same."
LENGTHS = {"ppo": "train.py's default length", "dqn": "2,000,000 frames (by default train.py ends before)"}
SIZES = Sizes()

TITLES = {
    "skill-ppo": "Time to skill, PPO: ours against Stable-Baselines3",
    "skill-dqn": "Time to skill, DQN: ours against Stable-Baselines3",
    "frames": "Frames a second",
    "explanations": "Exact explanations of the next 60 steps",
    "setup": "Set-up of the default run",
    "refresh": "A refresh of the vocabulary",
    "overhead": "What IBE, the log and the recording cost",
    "faults": "Training speed when the live view fails",
    "sweep": "Two runs side by side",
}

HOW = {
    "sb3_dummy_frames": "Stable-Baselines3's PPO collecting in 16 environments of a DummyVecEnv, without learning; the "
    "faster of its two vector environments is used in all other figures.",
    "sb3_subproc_frames": "The same in a SubprocVecEnv, a process for each environment, forked where "
    "that is possible: Stable-Baselines3 is then not charged for 16 imports of torch.",
    "frames_whole_ppo": "The whole pipeline of train.py, IBE, log and recording on, without set-up and evaluation, "
    "against learn() of Stable-Baselines3's PPO without its set-up.",
    "frames_whole_ppo_gymnasium_step": "The same, but Stable-Baselines3 steps with gymnasium's own step: in the figure "
    "above its environment has our lean step, which gives the same numbers in less time.",
    "frames_whole_bare": "The whole pipeline against gymnasium's own LunarLander-v3, unwrapped, stepped with random "
    "actions in two processes, their frames added up.",
    "frames_collect": "Our collector over two processes with an untrained PPO, without learning, against "
    "Stable-Baselines3's PPO with its learning taken out.",
    "frames_collect_gymnasium_step": "The same against Stable-Baselines3 with gymnasium's own step.",
    "frames_collect_bare": "Our collector against the same bare stepping.",
    "time_share_setup": "Share of the wall time of the shortened train.py run: making everything, starting workers.",
    "time_share_collect": "Waiting for the collector.",
    "time_share_learn": "The agent's updates.",
    "time_share_log": "Joining episodes and writing them to the log.",
    "time_share_refresh": "Learning the vocabulary anew.",
    "time_share_explain": "Flying the watched episode and explaining its every step.",
    "time_share_stream": "The recording, metrics.csv and the progress line.",
    "time_share_eval": "Evaluations.",
    "time_share_checkpoint": "Writing weights and flushing the log.",
    "explanations_batched_vs_naive": "explain() on moments of watched episodes of the demo agent, against one game "
    "that is restored at each moment and stepped with the policy called on one observation at a time.",
    "explanations_vs_engine": "The same explain() against Box2D alone: the engines' impulses and world.Step from the "
    "same moments with the actions of the naive loop; restoring, observations, rewards, policy and vocabulary are "
    "not in it, nor is the engines' noise.",
    "explanation_live_ms": "explain() on one moment at a time, median milliseconds, against one frame of a game at "
    "50 frames a second.",
    "explanations_what_if": "explain() with the answers to what it would do if it were told each of three values, "
    "against explain() without, on the same moments.",
    "explanation_live_what_if_ms": "The same on one moment at a time.",
    "setup_s": "Seconds from the start of the process of the default train.py (viewer=file) to its first batch, "
    "before it learns from it: the three below.",
    "setup_imports_s": "Until the parts of the run are made: Python, imports, composing and checking the settings.",
    "setup_making_s": "Making everything and starting workers: setup of time_s.",
    "setup_batch_s": "Waiting for the first batch: collect of time_s, with what of their start the workers still do.",
    "refresh_10k_s": "learn_vocabulary with the default settings on a log of 10,000 frames: flown ones of the demo "
    "agent and of random actions, repeated with a little noise in the states where more are needed.",
    "refresh_100k_s": "The same with 100,000 frames, against 10,000.",
    "refresh_1m_s": "The same with 1,000,000 frames, against 10,000.",
    "refresh_3m_seen_s": "The same after 3,000,000 frames in a log that holds 1,000,000, against 1,000,000 seen: "
    "it must not grow.",
    "refresh_1m_mb": "By how much the refresh on 1,000,000 frames raised the most resident memory of its process, "
    "pages of the log that it read included.",
    "overhead_recording": "Wall time of a shortened run of train.py with its recording against viewer=off, same seed.",
    "overhead_ibe": "The same run against refresh_every_frames=null: no vocabulary is learnt and nothing explained.",
    "share_log": "Share of the wall time that goes into the log, from time_s of the shortened run; there is no "
    "switch for it.",
    "share_recording": "Recording, metrics.csv and progress bar as a share of the wall time of the default run.",
    "share_ibe_log_recording": "Refresh, explanations, recording and log together as a share of the wall time of the "
    "default run of train.py.",
    "faults_none": "The training's own frames a second, without evaluations, in the second half of a shortened live "
    "run against its first half: by how much they differ without a fault.",
    "faults_killed": "The same where the viewer's server is killed after the first half.",
    "faults_stopped": "The same where the viewer's server is stopped (SIGSTOP) after the first half.",
    "faults_full_disk": "The same where the file of the recording can grow no further after the first half.",
    "faults_not_installed": "The second half of a run without the viewer, against that of an undisturbed run.",
    "faults_port_taken": "The second half of a run whose port somebody else takes before the server, against that of "
    "an undisturbed run.",
    "sweep_two_at_once": "Frames a second of a whole sweep of two shortened runs of one process each "
    "(collect.processes=1 collect.envs_per_process=128): runs_at_once=2 against 1. Starting and imports count.",
}


def _skill() -> dict[str, str]:
    told: dict[str, str] = {}
    for algorithm, name in ALGORITHMS.items():
        for label in LEVELS:
            told |= _level(algorithm, name, label)
        told[f"final_success_{algorithm}"] = (
            f"Success of ours at the end of {LENGTHS[algorithm]}, on {SIZES.fresh_episodes} episodes that the training "
            "has not seen. Median over seeds."
        )
        told[f"final_success_{algorithm}_min"] = "The worst seed's."
        told[f"run_wall_s_{algorithm}"] = (
            "Seconds of that whole run, with more evaluations than the default has; median over seeds."
        )
        told[f"run_wall_s_{algorithm}_min"] = "The fastest seed's."
        told[f"run_wall_s_{algorithm}_max"] = "The slowest seed's."
        if algorithm in SIZES.rewarded:
            told |= _rewarded(algorithm)
    return told


def _rewarded(algorithm: str) -> dict[str, str]:
    end = f"final_success_{algorithm}_rewarded"
    told = {end: "Success of these runs at their end, as above. Median over seeds.", f"{end}_min": "The worst seed's."}
    for label in LEVELS:
        at = f"to_{label}_{algorithm}_rewarded"
        told |= {
            f"time_{at}": f"Seconds to {label} % as above where ours also gets reward for following the instruction "
            f"(`{REWARDED}`). Stable-Baselines3 does not. Median over seeds.",
            f"frames_{at}": "The same in frames, median over seeds.",
            f"time_{at}_max": WORST,
            f"frames_{at}_max": WORST,
        }
    return told


def _level(algorithm: str, name: str, label: str) -> dict[str, str]:
    told = {
        f"time_to_{label}_{algorithm}": f"Seconds until the second of two {name} evaluations in a row with at least "
        f"{label} % of 100 unseen episodes landed on the pad; everything counts but imports and evaluations. "
        f"An evaluation is due every {SIZES.evaluate_every[algorithm]:,} frames. Median over seeds.",
        f"time_to_{label}_{algorithm}_max": WORST,
        f"frames_to_{label}_{algorithm}": "The same in frames, median over seeds.",
        f"frames_to_{label}_{algorithm}_max": WORST,
    }
    if "gymnasium" in SIZES.skill_steps[algorithm]:
        told[f"time_to_{label}_{algorithm}_gymnasium_step"] = (
            "Seconds as above against Stable-Baselines3 with gymnasium's own step; with the same seed it takes the "
            "same frames, number for number. Median over seeds."
        )
        told[f"time_to_{label}_{algorithm}_gymnasium_step_max"] = WORST
    return told


HOW |= _skill()

RULES = """\
Each ratio is ours divided by the other. Both sides of a ratio were run in turn, in one run, on the same machine, in
fresh processes with one thread each, in the same environment (Lunar Lander with pads) with the same observation
(state 9, instruction 1, given 1) and the same reward (the game's and our bonus of 100 for a success), unless its line
says otherwise. Values are medians over the repeats, or where their line says so the worst or the best of them; all
single measurements are in results.json. `>` and `<` mark a value over runs of which some ended before they reached the
level: they count up to their last evaluation, so that the value is a lower bound; where both sides are such bounds
there is no ratio. Below 1 is good for seconds and frames, above 1 for what is counted by the second.

Stable-Baselines3 runs with the settings of rl-zoo3 for the Lunar Lander on the CPU, in the faster of its vector
environments here (DQN: one environment, as in the zoo), and is evaluated by the same function on the same seeds as
ours. Its environment has our lean step, where a figure does not say that it has gymnasium's own; the numbers that they
give are the same. Its run ends as soon as it has reached 83 %, or at a cap; ours always goes on to its end.

`make bench PARTS=--short` measures the first figures of each kind in under ten minutes on two idle cores, with one seed
and one repeat, into runs/benchmarks-short. `make bench PARTS="skill-ppo --resume"` goes on where a run was stopped.
"""
