"""What lies beside the package in the repository comes into its wheel; ibe_rl/runtime/installation.py finds both."""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class WithWhatLiesBeside(BuildHookInterface):
    """Puts config files, scripts and the demo into ``ibe_rl/shipped``; an editable install has the repository's."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """See hatchling."""
        if version == "standard":
            parts = ("configs", "demo", "train.py", "explain.py")
            build_data["force_include"] |= {part: f"ibe_rl/shipped/{part}" for part in parts}
