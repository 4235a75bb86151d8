"""Every choice of configs/ and every dataclass of settings, for the tests that look at all of them."""

from dataclasses import is_dataclass
from pathlib import Path

from ibe_rl.config import settings as schemas
from ibe_rl.config.kinds import ROOMS, settings_of

ROOT = Path(__file__).parents[2]
CHOICES = sorted((path.parent.name, path.stem) for path in (ROOT / "configs").glob("*/*.yaml"))
KINDS = {"guest"} | {name for group, name in CHOICES if group in ROOMS}
"""Those that have a module of their own."""
OF_KINDS = {
    settings_of(group, path.stem)
    for group, room in ROOMS.items()
    for path in (ROOT / room.replace(".", "/")).glob("*.py")
    if path.stem in KINDS
}
SCHEMAS: list[type] = sorted(
    {item for item in vars(schemas).values() if is_dataclass(item) and isinstance(item, type)} | OF_KINDS,
    key=lambda item: item.__name__,
)
LIMITS = {"low", "high", "choices"}
"""What a setting with limits says of them."""
