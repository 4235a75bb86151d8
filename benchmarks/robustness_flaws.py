"""The flaws of instructors that ``benchmarks.robustness`` measures."""

from __future__ import annotations

from ibe_rl.instructors.flawed import FlawedConfig

CURVES: dict[str, dict[str, FlawedConfig]] = {
    "wrong, drawn at every step": {
        f"{p:g}": FlawedConfig(wrong=p, spell_steps=1) for p in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
    },
    "wrong, for 25 steps at a time": {f"{p:g}": FlawedConfig(wrong=p) for p in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)},
    "late by so many steps": {f"{d}": FlawedConfig(late_steps=d) for d in (0, 10, 25, 50, 75, 100)},
    "late, and a fifth wrong": {f"{d}": FlawedConfig(late_steps=d, wrong=0.2 * (d > 0)) for d in (0, 10, 25, 50, 75)},
    "late, a fifth wrong, half absent": {
        "0": FlawedConfig(),
        "25": FlawedConfig(late_steps=25, wrong=0.2, present=0.5),
    },
    "key kept down so many steps too long": {f"{d}": FlawedConfig(lasting_steps=d) for d in (0, 10, 25, 50)},
    "the same, and late by 25": {f"{d}": FlawedConfig(lasting_steps=d, late_steps=25 * (d > 0)) for d in (0, 10, 25)},
    "present so much of the time": {f"{p:g}": FlawedConfig(present=p) for p in (1.0, 0.75, 0.5, 0.25, 0.1, 0.05)},
}
"""What is corrupted and how much, the first without any flaw."""
ANEW = {
    "wrong 0.2": (("instructor=flawed", "instructor.wrong=0.2"), FlawedConfig(wrong=0.2)),
    "late 25, present 0.5": (
        ("instructor=flawed", "instructor.late_steps=25", "instructor.present=0.5"),
        FlawedConfig(late_steps=25, present=0.5),
    ),
    "late 25, wrong 0.2, present 0.5": (
        ("instructor=flawed", "instructor.late_steps=25", "instructor.wrong=0.2", "instructor.present=0.5"),
        FlawedConfig(late_steps=25, wrong=0.2, present=0.5),
    ),
}
"""Trained with such an instructor from the beginning."""
