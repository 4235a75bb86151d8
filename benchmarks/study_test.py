"""How often the registered test of a study rejects: without any effect, and with the one that power was stated for.

python -m benchmarks.study_test null STUDY [studies=1000] [people=60]     simulated people who ignore the words
python -m benchmarks.study_test power STUDY [studies=1000] [people=60]    the reported power, and that of whole studies

The whole studies take another way than ``study power``: people arrive, are assigned, drop out and are replaced; each
answer goes through the file of answers, and they are tested as ``study analyse`` does.
"""

from __future__ import annotations

import contextlib
import sys
import time
from pathlib import Path

import numpy as np

from ibe_rl.apps.study.answers import FINISHED, Answer, Answers
from ibe_rl.apps.study.columns import counted
from ibe_rl.apps.study.data import answers_given, tables_of
from ibe_rl.apps.study.exclusions import reasons
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.power import SimulatedStudies, rejections
from ibe_rl.apps.study.registered import TwoArms, permutation_p
from ibe_rl.apps.study.simulated import answer_page, draw_people, time_s
from ibe_rl.apps.study.sitting import enter, schedule_of
from ibe_rl.metrics.effect import share

DROP_OUT = 0.01
OTHER_SEEDS = 10_000_000


def simulated(study: Study, studies: int, people: int, reliance: tuple[float, float]) -> list[bool]:
    """In which studies the registered test rejects, as ``study power`` simulates them."""
    pair = (study.settings.test.arms[0], study.settings.test.arms[1])
    drawn = SimulatedStudies(study, lambda count, seed: draw_people(count, seed, reliance=reliance))
    return rejections(drawn, [people], studies, seed=0)[pair][:, 0].tolist()


def whole_study(study: Study, people: int, seed: int) -> bool:
    """Whether the registered test rejects in one study that is kept and read like a real one."""
    settings = study.settings
    with contextlib.closing(Answers(Path(":memory:"))) as answers:
        for lot, one in enumerate(draw_people(3 * people, OTHER_SEEDS + seed, drop_out=DROP_OUT)):
            if len(answers.held(pilots=True)[0]) == people:
                break
            person, random = enter(study, answers, pilot=True), np.random.default_rng([OTHER_SEEDS, seed, lot])
            for page in schedule_of(study, person):
                if random.random() < one.drop_out:
                    answers.release(-1.0)
                    break
                value, took = answer_page(one, study, page, 1, random), int(1000 * time_s(one, random))
                answers.keep(person, Answer(page.name, 1, value, took, 0))
            else:
                answers.end(person, FINISHED)
        data = tables_of(study, answers_given(answers, pilots=True))
    kept = data.people["person"][reasons(data.people, settings) == ""]
    trials = counted(data.trials)
    two = TwoArms.of(trials[trials["person"].isin(kept)], (settings.test.arms[0], settings.test.arms[1]))
    return permutation_p(two, settings.test.resamples, seed) < settings.test.alpha


def main(arguments: list[str]) -> None:
    """Print how often the test rejects, with its interval."""
    what, folder = arguments[:2]
    given = {"studies": 1_000, "people": 60} | {
        name: int(value) for name, _, value in (each.partition("=") for each in arguments[2:])
    }
    study, begin = open_study(Path(folder)), time.perf_counter()
    reliance = (0.0, 0.0) if what == "null" else (0.0, 1.0)
    rejected = {f"{what}, as study power simulates it": simulated(study, given["studies"], given["people"], reliance)}
    if what == "power":
        others = [whole_study(study, given["people"], seed) for seed in range(given["studies"])]
        rejected["power, in whole studies that are kept and read"] = others
    for name, each in rejected.items():
        found = share(each)
        sys.stdout.write(
            f"{name}: {100 * found.value:.1f} % [{100 * found.low:.1f}, {100 * found.high:.1f}] of {len(each)}\n"
        )
    sys.stdout.write(f"{time.perf_counter() - begin:.0f} s\n")


if __name__ == "__main__":
    main(sys.argv[1:])
