"""What the recording, IBE and the log cost: the same run of train.py with and without them."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks import ours
from benchmarks.levels import figure, plain
from benchmarks.plan import Plan
from benchmarks.skill import Figures, Say

SWITCHES = {
    "on": (),
    "without_recording": ("viewer=off",),
    "without_ibe": ("refresh_every_frames=null",),
}
PARTS_OF_SHARE = ("refresh", "explain", "stream", "log")


def run(plan: Plan, say: Say) -> Iterator[Figures]:
    """Run all of them in turn, as often as asked; yields the figures so far after each round."""
    sizes = plan.sizes
    found: dict[str, list[ours.TrainingRun]] = {name: [] for name in (*SWITCHES, "default")}
    length = [f"total_frames={sizes.default_frames}"] if sizes.default_frames else []
    for repeat in range(plan.repeats):
        say(f"overhead, round {repeat + 1} of {plan.repeats}")
        for name, switch in SWITCHES.items():
            shortened = f"total_frames={sizes.short_frames}"
            found[name].append(ours.train(f"seed={repeat}", *sizes.overrides, shortened, *switch))
            say(f"  {name}: {found[name][-1].summary['wall_s']:.1f} s")
        found["default"].append(ours.train(f"seed={repeat}", *sizes.overrides, *length))
        say(f"  the default run: {found['default'][-1].summary['wall_s']:.1f} s")
        yield figures(found)


def figures(found: dict[str, list[ours.TrainingRun]]) -> Figures:
    """Wall time with against without, and shares of the wall time."""
    wall = {name: plain([run.summary["wall_s"] for run in runs]) for name, runs in found.items()}
    return [
        figure("overhead_recording", "s", wall["on"], wall["without_recording"]),
        figure("overhead_ibe", "s", wall["on"], wall["without_ibe"]),
        figure("share_log", "share", plain([run.share("log") for run in found["on"]])),
        figure("share_recording", "share", plain([run.share("stream") for run in found["default"]])),
        figure("share_ibe_log_recording", "share", plain([run.share(*PARTS_OF_SHARE) for run in found["default"]])),
    ]
