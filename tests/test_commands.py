"""Every command of README and docs is run: here with small settings, or by the test that stands in the table."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
from processes import ROOT, SMALL, call

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
WHOLE_PAGES = {
    "OWN_AGENT.md": "test_own_docs.py",
    "OWN_LOG.md": "test_own_docs.py",
    "STUDY.md": "apps/study/test_study_docs.py",
}
"""Pages whose commands are all run by one test of theirs; docs/LOG.md has none."""
SWEPT = "apps/sweep/test_launch.py::test_a_sweep_with_a_killed_run_goes_on_and_is_taken_up_again"
SERVED = "view/test_viewer.py::test_runs_are_served_until_they_are_closed"
TRAINED = "envs/test_trainings.py::test_it_trains_learns_a_vocabulary_and_explains"
ELSEWHERE = {
    "train.py env=fetch_reach": TRAINED,
    "train.py env=pendulum": TRAINED,
    "train.py env=acrobot": TRAINED,
    "train.py env=mountain_car": "envs/test_classic_control.py::test_a_car_that_arrives_says_that_it_swings_more",
    "train.py env=bipedal_walker": TRAINED,
    "train.py logger=mlflow loggers.mlflow.uri=http://127.0.0.1:5000": (
        "apps/loggers/test_mlflow_logger.py::test_it_reads_curves_texts_pictures_and_settings"
    ),
    "explain.py agent=model.zip env=lander clip=landing.gif": (
        "apps/external/test_explaining.py::test_a_model_file_is_explained_from_the_command_line"
    ),
    "train.py env=highway": "envs/test_highway.py::test_it_trains_and_explains",
    "train.py env=car_racing": "envs/test_car_racing.py::test_it_trains_on_images_and_explains",
    "train.py instructor=human": "apps/teach/test_taught_session.py::test_every_step_says_what_the_page_had_sent",
    "train.py instructor=human instructor.words=[left,hold,right]": (
        "apps/teach/test_taught_words.py::test_the_agent_calls_a_movement_what_its_teacher_calls_it"
    ),
    "train.py instructor=human instructor.words=[left,hold,right] instructor.group_phrases=true": (
        "apps/teach/test_taught_words.py::test_the_words_and_the_mark_are_logged"
    ),
    "train.py instructor=recorded instructor.recording=RUN stop_after_frames=FRAMES": (
        "training/test_resume.py::test_a_recorded_session_is_trained_anew"
    ),
    "train.py experiment=paper": "apps/paper/test_paper_report.py::test_training_can_go_on_to_the_report",
    "train.py resume=RUN total_frames=3_000_000": (
        "training/test_resume.py::test_settings_that_may_change_take_effect"
    ),
    "train.py resume=runs/2026-01-31_12-00-00": (
        "training/test_resume.py::test_every_number_is_that_of_the_uninterrupted_run"
    ),
    "train.py resume=runs/DATE_TIME": "training/test_resume.py::test_every_number_is_that_of_the_uninterrupted_run",
    "train.py collect.engine=ray collect.address=FIRST:6379 collect.processes=8": (
        "apps/ray/test_ray_workers.py::test_training_on_two_nodes_is_that_in_two_processes"
    ),
    "train.py -m seed=0,1,2 agent=ppo,dqn": "view/test_viewer.py::test_a_sweep_makes_a_folder_a_run",
    "train.py -m sweep=horizon": "config/test_config.py::test_every_sweep_varies_what_it_is_called_after",
    "train.py -m sweep=horizon run_dir=DIR": SWEPT,
    "train.py -m sweep=seeds runs_on=FIRST:6379 runs_at_once=8": (
        "apps/ray/test_ray_run.py::test_a_sweep_runs_on_the_cluster"
    ),
    "explain.py sweep=DIR": "apps/sweep/test_sweep_report.py::test_the_table_holds_every_condition_and_metric",
    "explain.py task=evaluate": "scripts/test_judging_scripts.py::test_what_the_agent_says_is_judged",
    "explain.py task=compare": "scripts/test_judging_scripts.py::test_mappings_are_compared_on_the_same_log",
    "explain.py task=figures": "apps/paper/test_paper_report.py::test_the_numbers_are_all_there_and_strict_json",
    "explain.py task=summary": "apps/summary/test_summarising.py::test_it_says_the_most_important_in_the_terminal",
    "explain.py run=RUN task=summary with=OTHER": (
        "apps/summary/test_summarising.py::test_the_same_seeds_give_the_same_numbers_and_another_run_is_set_beside"
    ),
    "explain.py run=RUN task=summary with_frame=400_000": (
        "apps/summary/test_summarising.py::test_it_holds_shares_moments_episodes_and_the_other_agent"
    ),
    "explain.py run=RUN task=predictors": (
        "scripts/test_judging_scripts.py::test_predictors_are_held_against_the_exact_one"
    ),
    "explain.py run=RUN predictor=ensemble": (
        "scripts/test_judging_scripts.py::test_an_episode_is_explained_by_what_is_learnt_from_the_log"
    ),
    "-m ibe_rl.apps.study make run=demo serve=true": (
        "apps/study/test_study_commands.py::test_a_study_is_made_and_served"
    ),
    "-m ibe_rl.viewer DIR": SERVED,
    "-m ibe_rl.viewer runs/2026-01-31_12-00-00": SERVED,
    "-m ibe_rl.viewer runs/one runs/another": SERVED,
}
"""Commands to the tests that run them with other values, or what they start."""
SMALLER = ["total_frames=2048", "refresh_every_frames=1024", "eval_every_frames=2048", "eval_episodes=2"]
SMALLER += ["mapping.horizon_steps=30", "viewer=off", "predictor.processes=1"]


def commands() -> set[str]:
    """Indented lines that call python, without it and without what stands behind #."""
    texts = [page.read_text() for page in PAGES if page.name not in {*WHOLE_PAGES, "LOG.md"}]
    lines = [line for text in texts for line in re.findall(r"^    (?:\.venv/bin/)?python (.*)$", text, re.MULTILINE)]
    return {shlex.join(shlex.split(line, comments=True)).replace("'", "") for line in lines}


HERE = sorted(commands() - ELSEWHERE.keys())


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the small trained agent of the repository, which is its newest run too."""
    for run in ("demo", "runs/one"):
        shutil.copytree(ROOT / "demo", tmp_path / run)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", HERE)
def test_it_runs(command: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script, *settings = shlex.split(command)
    learnt = ["predictor.updates=5"] if "predictor=ensemble" in settings else []
    if script == "explain.py":
        call("explain", *settings, "viewer=off", "predictor.processes=1", "predictor.futures=1")
        assert "went as predicted" in capsys.readouterr().out
    elif settings == ["--cfg", "job"]:
        call("train", *settings)
        assert "total_frames: 600000" in capsys.readouterr().out
    else:
        call("train", *settings, *SMALL, *SMALLER, *learnt, "run_dir=mine")
        assert (place / "mine" / "summary.json").is_file()


@pytest.mark.parametrize("test", sorted({*ELSEWHERE.values(), *WHOLE_PAGES.values()}))
def test_what_runs_the_others_is_there(test: str) -> None:
    file, _, name = test.partition("::")
    assert f"def {name}" in (ROOT / "tests" / file).read_text()


def test_no_command_is_listed_that_no_page_has() -> None:
    assert ELSEWHERE.keys() <= commands()
