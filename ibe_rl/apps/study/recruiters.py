"""Where people come from, and where they go back to."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from ibe_rl.apps.study.settings import CODES, MTURK, PROLIFIC, SONA

ID_CHARACTERS = 128
CODES_FILE = "codes.txt"
"""The one-time codes of a laboratory, one in a line; without this file any code lets one person in."""
CODE_LETTERS, CODE_LENGTH = "23456789abcdefghjkmnpqrstuvwxyz", 8  # none that looks like another


class UnknownRecruitError(ValueError):
    """An address without what the recruiter adds to it; the message says what is missing."""


@dataclass(frozen=True)
class Recruiter:
    """A recruiter.

    Attributes:
        id: the parameter of the address that holds a person's ID there.
        fields: further parameters that are kept.
        back: from the completion code, or its lack, and the parameters, to the address to return to; empty: the code is
            shown, there is no address.
    """

    id: str
    fields: tuple[str, ...]
    back: Callable[[str, Mapping[str, str]], str]


def _prolific(code: str, _: Mapping[str, str]) -> str:
    return f"https://app.prolific.com/submissions/complete?cc={quote(code, safe='')}"


def _sona(code: str, fields: Mapping[str, str]) -> str:
    """The code is the address that SONA shows, up to the ID that it wants back."""
    return f"{code}&survey_code={quote(fields.get('survey_code', ''), safe='')}"


def _shown(_code: str, _: Mapping[str, str]) -> str:
    return ""


KNOWN = {
    CODES: Recruiter("code", (), _shown),
    PROLIFIC: Recruiter("PROLIFIC_PID", ("STUDY_ID", "SESSION_ID"), _prolific),
    SONA: Recruiter("survey_code", (), _sona),
    MTURK: Recruiter("workerId", ("assignmentId", "hitId"), _shown),
}


def recruit_of(name: str, parameters: Mapping[str, str]) -> tuple[str, dict[str, str]]:
    """Who comes with the parameters of an address: the ID, and all that the recruiter needs back.

    Raises:
        UnknownRecruitError: naming what is missing.
    """
    recruiter = KNOWN[name]
    external = parameters.get(recruiter.id, "")
    if not 0 < len(external) <= ID_CHARACTERS or external.startswith("{{"):
        raise UnknownRecruitError(f"the address has no {recruiter.id}")
    fields = {one: parameters.get(one, "")[:ID_CHARACTERS] for one in recruiter.fields}
    return external, {recruiter.id: external, **fields}


def way_out(name: str, ended: str, codes: Mapping[str, str], fields: Mapping[str, str]) -> dict[str, str]:
    """What somebody who has left is shown: a code, and an address to return to; each may be empty.

    Args:
        name: of the recruiter.
        ended: how they left; who withdraws has no code.
        codes: the completion code of each way to leave.
        fields: that the recruiter sent; empty if it sent nobody.
    """
    code = codes.get(ended, "")
    address = KNOWN[name].back(code, fields) if code and fields else ""
    return {"code": "" if name == SONA else code, "address": address}


def is_known_code(folder: Path, code: str) -> bool:
    """Whether a laboratory gave out this code; any code is known where it listed none."""
    path = folder / CODES_FILE
    return not path.exists() or code in path.read_text(encoding="utf-8").split()


def write_codes(folder: Path, count: int) -> Path:
    """Write one-time codes for so many people, unless there are some; returns the file."""
    path = folder / CODES_FILE
    if not path.exists():
        codes = ("".join(secrets.choice(CODE_LETTERS) for _ in range(CODE_LENGTH)) for _ in range(count))
        path.write_text("".join(f"{code}\n" for code in codes), encoding="utf-8")
    return path
