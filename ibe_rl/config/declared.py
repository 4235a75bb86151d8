"""What a settings dataclass declares: of each setting the type, the default, the limits and the comment beside it."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from functools import cache
from io import StringIO
from textwrap import dedent
from tokenize import COMMENT, generate_tokens
from types import NoneType
from typing import Any, get_args, get_origin, get_type_hints

from ibe_rl.config.limits import MISSING as TO_BE_GIVEN
from ibe_rl.config.limits import allowed_values

_WORDS = {int: "integer", float: "number", bool: "true or false", str: "text", NoneType: "null"}


@dataclass(frozen=True)
class DeclaredSetting:
    """A setting as it is declared.

    Attributes:
        key: as typed, below its group.
        default: as typed; None for one that has to be given.
        allowed: its type and limits.
        meaning: the comment beside it.
    """

    key: str
    default: str | None
    allowed: str
    meaning: str


def declared(schema: Any, prefix: str = "") -> list[DeclaredSetting]:
    """The settings of a dataclass and of those below it, without ``kind``, which the choice of a file gives."""
    return [one for item in fields(schema) for one in _declared(schema, item, prefix) if item.name != "kind"]


def _declared(schema: Any, item: Field[Any], prefix: str) -> Iterator[DeclaredSetting]:
    typed = item.metadata.get("typed", item.name)
    if typed is None:
        return
    key, hint, below = f"{prefix}{typed}", get_type_hints(schema)[item.name], _dataclass_in(schema, item)
    if below is None or get_origin(hint) is list:
        limits = allowed_values(item.metadata)
        kind = "" if limits.startswith("one of") else _words(hint)
        yield DeclaredSetting(
            key, _default(item), ", ".join(filter(None, (kind, limits))), meanings(schema).get(item.name, "")
        )
    if below is not None:
        yield from declared(below, f"{key}[0]." if get_origin(hint) is list else f"{key}.")


def _dataclass_in(schema: Any, item: Field[Any]) -> Any:
    hint = get_type_hints(schema)[item.name]
    return next((one for one in (hint, *get_args(hint)) if is_dataclass(one)), None)


def _words(hint: Any) -> str:
    """A type in words."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is list:
        return "list" if is_dataclass(inner[0]) else f"list of {_words(inner[0])}"
    if origin is dict:
        return "names and values"
    return _WORDS.get(hint) or " or ".join(map(_words, inner)) or "any value"


def _default(item: Field[Any]) -> str | None:
    value = item.default if item.default_factory is MISSING else item.default_factory()
    return None if value is MISSING or value == TO_BE_GIVEN else as_typed(value)


def as_typed(value: Any) -> str:
    """A value as it is typed."""
    if isinstance(value, list):
        return f"[{','.join(map(as_typed, value))}]"
    if isinstance(value, dict):
        return f"{{{','.join(f'{key}: {as_typed(one)}' for key, one in value.items())}}}"
    if isinstance(value, float):
        return f"{value:.4g}"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return str(value)


@cache
def meanings(schema: type) -> dict[str, str]:
    """The comment beside each field, or in the line above it, those of its bases too."""
    found: dict[str, str] = {}
    for one in reversed(schema.__mro__):
        if is_dataclass(one):
            found |= _comments(dedent(inspect.getsource(one)))
    return found


def _comments(source: str) -> dict[str, str]:
    comments = [token for token in generate_tokens(StringIO(source).readline) if token.type == COMMENT]
    texts = {one.start[0]: one.string.lstrip("# ").replace("None", "null") for one in comments}
    alone = {one.start[0] for one in comments if one.line.lstrip().startswith("#")}
    found = {}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            lines = [*range(node.lineno, (node.end_lineno or 0) + 1), *alone & {node.lineno - 1}]
            found[node.target.id] = next((texts[line] for line in lines if line in texts), "")
    return found
