"""The dataset follows Psych-DS: names of files, and a codebook that has every column."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from ibe_rl.apps.study.codebook import CODEBOOK, data_file, description, write_dataset, write_texts
from ibe_rl.apps.study.columns import ITEMS, PEOPLE, TRIALS

NAME = re.compile(r"([a-z]+-[a-zA-Z0-9]+)(_[a-z]+-[a-zA-Z0-9]+)*_data\.csv")
"""What Psych-DS allows."""


@pytest.mark.parametrize("study", ["my_study", "Pilot 2", "été", "..."])
def test_names_of_files(study: str) -> None:
    assert NAME.fullmatch(data_file(study, "trials"))
    assert data_file("my_study", "trials") == "study-MyStudy_table-trials_data.csv"


def test_every_column_is_described_once(tmp_path: Path) -> None:
    columns = {"trials": TRIALS, "items": ITEMS, "people": PEOPLE}
    tables = {name: pd.DataFrame([[1.0] * len(known)], columns=[*known]) for name, known in columns.items()}
    files = write_dataset(tmp_path, "mine", "A study", False, tables)
    assert [file.relative_to(tmp_path).parts[0] for file in files] == ["data", "data", "data", CODEBOOK]
    book = json.loads(files[-1].read_text())
    assert (book["@type"], book["@context"], book["name"]) == ("Dataset", "https://schema.org", "A study")
    described = [one["name"] for one in book["variableMeasured"]]
    assert len(described) == len(set(described))
    for file in files[:-1]:
        assert {*pd.read_csv(file).columns} <= {*described}
        assert NAME.fullmatch(file.name)
    assert all(one["description"] for one in book["variableMeasured"])


def test_a_pilot_is_called_one() -> None:
    assert description("A study", True)["description"].startswith("Pilot")
    assert "Pilot" not in description("A study", False)["description"]


def test_texts_are_no_formulas(tmp_path: Path) -> None:
    write_texts(tmp_path / "texts.csv", [(1, "comment", "", "=1+1"), (2, "comment", "", 'he said "hi",\nthen left')])
    table = pd.read_csv(tmp_path / "texts.csv")
    assert table["text"].tolist() == ["'=1+1", 'he said "hi",\nthen left']
