"""Export a run's log as a Minari dataset, and import a dataset as a run folder.

python -m ibe_rl.apps.minari export runs/NAME mine/log-v0
python -m ibe_rl.apps.minari import mine/log-v0 env=NAME run_dir=runs/imported
python -m ibe_rl.apps.minari import FILE.npz env=NAME run_dir=runs/imported
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from ibe_rl.apps.datasets.exporting import export_log
from ibe_rl.apps.datasets.importing import import_log
from ibe_rl.apps.datasets.instruction_source import RULE
from ibe_rl.config.command_line import command_on
from ibe_rl.runtime.installation import typed
from ibe_rl.runtime.printed import prepare_output, visible
from ibe_rl.types import ConfigError

__all__ = ["export_log", "import_log", "minari_command"]


def minari_command(arguments: Sequence[str] | None = None) -> int:
    """Export or import from the command line."""
    prepare_output()
    parser = argparse.ArgumentParser(
        prog=typed("minari"), description="Logs for and from Minari, and from files of arrays."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    out = commands.add_parser("export", help="a run's log as a dataset")
    out.add_argument("run", help="folder of the run")
    out.add_argument("dataset", help="name of the dataset, as mine/log-v0")
    out.add_argument("--newest", type=int, help="number of episodes, the newest; default: all")
    into = commands.add_parser("import", help="a dataset as a run folder")
    into.add_argument("dataset", help="name of a local Minari dataset, or a file of arrays (.npz, .hdf5)")
    into.add_argument("settings", nargs="*", help="of explain.py: env=…, run_dir=…, mapping=…")
    into.add_argument("--instruction", help=f"key of the infos, or {RULE} for the environment's own rule")
    into.add_argument("--state", help="MODULE:NAME, a function of one observation to the state")
    asked, others = parser.parse_known_args(arguments)
    if asked.command == "export" or not all("=" in one and not one.startswith("-") for one in others):
        asked = parser.parse_args(arguments)  # which refuses them
    else:
        asked.settings += others  # settings behind an option
    try:
        if asked.command == "export":
            made = export_log(asked.run, asked.dataset, asked.newest)
            line = f"{asked.dataset}: {made.total_episodes:,} episodes, {made.total_steps:,} steps"
        else:
            folder = import_log(asked.dataset, asked.settings, asked.instruction, asked.state)
            command = f"{command_on(folder, 'explain', 'run')} agent=…"
            line = f"{visible(str(folder))}: explain an agent in its words with {command}"
    except ConfigError as error:
        sys.exit(f"error: {visible(str(error))}")
    sys.stdout.write(f"{line}\n")
    return 0


if __name__ == "__main__":
    sys.exit(minari_command())
