"""Settings from values of a program, as the command line would have them."""

import pytest

import ibe_rl


@pytest.mark.parametrize("names", ["csv", ["csv", "tensorboard"]])
def test_loggers_are_chosen_by_name(names: str | list[str]) -> None:
    made = ibe_rl.settings(logger=names, loggers={"csv": {"pictures": False}}, run_dir="run", viewer="off")
    assert list(made.loggers) == ([names] if isinstance(names, str) else names)
    assert made.loggers["csv"].pictures is False


def test_a_logger_is_no_kind_of_which_there_is_one() -> None:
    with pytest.raises(ibe_rl.ConfigError, match=r"^logger: no such setting; allowed are seed"):
        ibe_rl.settings(logger={"kind": "ibe_rl.apps.loggers.csv:Csv"}, run_dir="run", viewer="off")
