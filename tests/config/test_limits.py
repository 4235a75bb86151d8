"""Every limit of every setting holds, and the message names the key, the value and what is allowed."""

import math
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields
from typing import Any

import pytest
from every_setting import LIMITS, SCHEMAS

from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.config import settings as schemas
from ibe_rl.config.limits import check
from ibe_rl.config.settings import (
    InstructorConfig,
    PredictorConfig,
    TrainConfig,
    ViewerConfig,
)
from ibe_rl.ibe import IBEConfig
from ibe_rl.types import ConfigError


def default(schema: type) -> Any:
    """An instance with every part of it; what has no default stays missing."""
    parts = {"agent": PPOConfig, "env": schemas.EnvConfig, "instructor": InstructorConfig, "mapping": IBEConfig}
    parts |= {"predictor": PredictorConfig, "viewer": ViewerConfig}
    names = {item.name for item in fields(schema)}
    return schema(**{name: part() for name, part in parts.items() if name in names})


def neighbour(limit: float, whole: bool, towards: float) -> float:
    return limit + math.copysign(1, towards) if whole else math.nextafter(limit, towards)


def outside(item: Field[Any]) -> Iterator[Any]:
    limits, whole = item.metadata, "int" in str(item.type)
    if limits["choices"]:
        yield from ("nonsense", "", limits["choices"][0].upper())
    for limit, towards in ((limits["low"], -math.inf), (limits["high"], math.inf)):
        if limit is not None:
            yield from (neighbour(limit, whole, towards), towards)
    if not limits["choices"]:
        yield math.nan


def inside(item: Field[Any]) -> Iterator[Any]:
    limits, whole = item.metadata, "int" in str(item.type)
    yield from limits["choices"]
    for limit, towards in ((limits["low"], math.inf), (limits["high"], -math.inf)):
        if limit is not None:
            yield from (limit, neighbour(limit, whole, towards))
    if "None" in str(item.type):
        yield None


LIMITED = [
    (schema, item)
    for schema in SCHEMAS
    for item in fields(schema)
    if any(item.metadata.get(name) not in (None, ()) for name in LIMITS)
]
EVERY_LIMIT = pytest.mark.parametrize(("schema", "item"), LIMITED, ids=[f"{s.__name__}.{i.name}" for s, i in LIMITED])


@EVERY_LIMIT
def test_a_value_just_inside_its_limits_passes(schema: type, item: Field[Any]):
    assert item.default is not MISSING
    values = [item.default, *inside(item)]
    for value in values:
        config = default(schema)
        setattr(config, item.name, value)
        check(config)


@EVERY_LIMIT
def test_a_value_just_outside_its_limits_is_refused(schema: type, item: Field[Any]):
    for value in outside(item):
        config = default(schema)
        setattr(config, item.name, value)
        with pytest.raises(ConfigError, match=rf"^{item.name}=.*: allowed is \S+"):
            check(config)


def test_the_message_names_the_whole_key_the_value_and_what_is_allowed():
    config = default(TrainConfig)
    config.collect.processes = 0
    with pytest.raises(ConfigError, match=r"^collect\.processes=0: allowed is at least 1 and at most 64$"):
        check(config)
    config = default(TrainConfig)
    config.viewer.mode = "loud"
    with pytest.raises(ConfigError, match=r"^viewer\.mode=loud: allowed is one of live, file, off$"):
        check(config)


def test_every_number_has_a_limit():
    for schema in SCHEMAS:
        for item in fields(schema):
            assert item.metadata or not any(number in str(item.type).split("[")[0] for number in ("int", "float"))
