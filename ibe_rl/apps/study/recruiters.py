"""Where people come from, and where they go back to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from urllib.parse import quote

from ibe_rl.apps.study.answers import FINISHED, NO_CONSENT, SCREENED_OUT

ID_CHARACTERS = 128


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
    return f"{code}&survey_code={quote(fields['survey_code'], safe='')}" if code.startswith("https://") else ""


def _shown(_code: str, _: Mapping[str, str]) -> str:
    return ""


KNOWN = {
    "codes": Recruiter("code", (), _shown),
    "prolific": Recruiter("PROLIFIC_PID", ("STUDY_ID", "SESSION_ID"), _prolific),
    "sona": Recruiter("survey_code", (), _sona),
    "mturk": Recruiter("workerId", ("assignmentId", "hitId"), _shown),
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
    """What somebody who has left is shown: a code, and an address to return to; each may be empty."""
    code = codes.get(ended if ended in (FINISHED, SCREENED_OUT, NO_CONSENT) else SCREENED_OUT, "")
    return {"code": code, "address": KNOWN[name].back(code, fields) if code and fields else ""}
