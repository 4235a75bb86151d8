"""The tables of a study as files that others can read: CSV with a codebook, by the convention Psych-DS."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ibe_rl.apps.study.columns import ITEMS, PEOPLE, TRIALS
from ibe_rl.storage.run_folder import write_atomically

DATA_FOLDER, CODEBOOK = "data", "dataset_description.json"
_DIGITS = "%.6g"


def data_file(study: str, table: str) -> str:
    """Name of a table's file: keywords of letters and digits, then ``_data.csv``.

    Args:
        study: name of its folder.
        table: ``trials``, ``items`` or ``people``.
    """
    word = "".join(part[:1].upper() + part[1:] for part in re.findall("[A-Za-z0-9]+", study)) or "Study"
    return f"study-{word}_table-{table}_data.csv"


def write_dataset(folder: Path, study: str, title: str, pilot: bool, tables: Mapping[str, pd.DataFrame]) -> list[Path]:
    """Write the tables and their codebook.

    Args:
        folder: of the dataset; the tables go into ``data/``.
        study: name of the study's folder.
        title: of the study.
        pilot: the people are simulated or try the study out.
        tables: ``trials``, ``items`` and ``people``.

    Returns:
        The files.
    """
    (folder / DATA_FOLDER).mkdir(parents=True, exist_ok=True)
    files = []
    for name, table in tables.items():
        text = table.to_csv(index=False, float_format=_DIGITS, lineterminator="\n")
        files.append(folder / DATA_FOLDER / data_file(study, name))
        _write(files[-1], text)
    files.append(folder / CODEBOOK)
    _write(files[-1], json.dumps(description(title, pilot), indent=1) + "\n")
    return files


def description(title: str, pilot: bool) -> dict[str, Any]:
    """The codebook: every column of every table, each name once."""
    columns = {**TRIALS, **ITEMS, **PEOPLE}
    note = "Pilot: no participants of the study, simulated people or people who tried it out. " if pilot else ""
    return {
        "@context": "https://schema.org",
        "@type": "Dataset",
        "name": title,
        "description": f"{note}Answers of a study in which people predict what an agent will do, with and without its "
        "explanations. A row for each trial, for each item of a scale, and for each person.",
        "schemaVersion": "Psych-DS 1.5.1",
        "variableMeasured": [{"@type": "PropertyValue", "name": name, **about} for name, about in columns.items()],
    }


def write_texts(path: Path, rows: Sequence[tuple[int, str, str, str]]) -> None:
    """Write what people wrote in their own words, apart from the dataset, as it may tell who they are."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["person", "page", "question", "text"])
    table.writerows([(person, page, question, _harmless(written)) for person, page, question, written in rows])
    _write(path, text.getvalue())


def _harmless(text: str) -> str:
    """A text that a spreadsheet does not take for a formula."""
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


def _write(path: Path, text: str) -> None:
    write_atomically(path, lambda stream: stream.write(text.encode()))
