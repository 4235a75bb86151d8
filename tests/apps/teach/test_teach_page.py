"""The page of the lesson in a real browser, beside a real training: everything that a person can see and do there."""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations, pairwise

import pytest
from browsers import browsing
from clients import HOST, VALUES, Room, eventually, open_room
from pages import Taught, opened, taught, until
from playwright.sync_api import Browser, Page

from ibe_rl.apps.teach.server import Server

ABOUT = {"name": "a game", "run": "a run", "total_frames": 1_000, "hold_steps": 0, "others": 3}
AXES = (("x", "width"), ("y", "height"))
LIVE_VIEW = "http://127.0.0.1:9090/?url=x"
IN_FLIGHT = """(() => {
  const { explanation, frame, scene } = lesson.now;
  if (!explanation || !explanation.path || explanation.episode !== frame.episode || frame.step < 5) return false;
  const inPicture = explanation.path.filter(([x, y]) => x > 0 && x < scene.size[0] && y > 0 && y < scene.size[1]);
  if (inPicture.length < 2) return false; // it has flown out at the top
  const [from, to] = [inPicture.at(0), inPicture.at(-1)];
  return Math.hypot(from[0] - to[0], from[1] - to[1]) > scene.size[0] / 20;
})()"""
PAUSED_IN_FLIGHT = f"{IN_FLIGHT} && (document.getElementById('pause').click() || true)"
TEAL = """() => {
  const canvas = document.getElementById("canvas");
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let found = 0;
  for (let i = 0; i < pixels.length; i += 4) {
    const [red, green, blue] = pixels.slice(i, i + 3); // a thin slanting line has no pixel of its full colour
    found += green > red + 50 && blue > red + 50 && green > blue;
  }
  return found;
}"""


@dataclass
class Classroom:
    """A training, and the page that instructs it."""

    training: Taught
    page: Page
    browser: Browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with browsing() as found:
        yield found


@pytest.fixture(scope="module")
def classroom(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Classroom]:
    """A training that has learnt its first vocabulary, from the oracle's words; at real time from then on."""
    folder = tmp_path_factory.mktemp("lesson") / "run"
    with taught(folder, "instructor.speed=20", "refresh_every_frames=1500", "total_frames=1_000_000") as training:
        page = opened(browser, training.address)
        page.click("#oracle")
        until(page, "lesson.now.vocabulary !== null && lesson.now.explanation !== null")
        page.click("#oracle")
        page.select_option("#speed", "1")
        until(page, "!lesson.now.controls.oracle && lesson.now.controls.speed === 1")
        yield Classroom(training, page, browser)


@contextmanager
def key(page: Page) -> Iterator[int]:
    page.keyboard.down("ArrowLeft")
    yield -1
    page.keyboard.up("ArrowLeft")


@contextmanager
def other_key(page: Page) -> Iterator[int]:
    page.keyboard.down("ArrowDown")
    yield 0
    page.keyboard.up("ArrowDown")


@contextmanager
def button(page: Page) -> Iterator[int]:
    page.hover("#values button:nth-child(3)")
    page.mouse.down()
    yield 1
    page.mouse.up()


@contextmanager
def touch(page: Page) -> Iterator[int]:
    """A finger on the left third of the picture."""
    box = page.locator("#stage").bounding_box()
    assert box is not None
    finger = {"x": box["x"] + 0.1 * box["width"], "y": box["y"] + 0.5 * box["height"]}
    session = page.context.new_cdp_session(page)
    session.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [finger]})
    yield -1
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    session.detach()


@pytest.mark.parametrize("way", [key, other_key, button, touch])
def test_each_way_to_instruct_counts_as_long_as_it_lasts(classroom: Classroom, way):
    page = classroom.page
    until(page, "lesson.now.frame.by === 'nobody' && lesson.now.frame.instruction === null")
    with way(page) as value:
        until(page, f"lesson.now.frame.by === 'person' && lesson.now.frame.instruction === {value}")
        marked = page.locator("#values button.on").evaluate_all("all => all.map((one) => Number(one.dataset.value))")
        assert marked == [value]
        until(page, f"document.getElementById('instruction').textContent === 'you say {signed(value)}'")
    until(page, "lesson.now.frame.by === 'nobody'")
    until(page, "document.getElementById('instruction').textContent === 'no instruction'")


def signed(value: int) -> str:
    return {-1: "\u22121", 0: "0", 1: "+1"}[value]


def test_a_pause_by_button_and_its_end_by_the_space_bar(classroom: Classroom):
    page = classroom.page
    page.click("#pause")
    until(page, "lesson.now.controls.paused && document.getElementById('pause').textContent === 'resume'")
    before = stands(page)
    page.locator("#pause").blur()
    page.keyboard.press("Space")
    until(page, f"!lesson.now.controls.paused && lesson.received > {before} + 5")


def test_the_speed(classroom: Classroom):
    page = classroom.page

    def steps_in_a_second() -> float:
        start = page.evaluate("[lesson.received, performance.now()]")
        time.sleep(1)
        end = page.evaluate("[lesson.received, performance.now()]")
        return 1000 * (end[0] - start[0]) / (end[1] - start[1])

    page.select_option("#speed", "0.25")
    until(page, "lesson.now.controls.speed === 0.25")
    assert eventually(lambda: 0 < steps_in_a_second() < 16)  # 12.5; a page that was held up gets several at once
    page.select_option("#speed", "null")
    until(page, "lesson.now.controls.speed === null")
    assert eventually(lambda: steps_in_a_second() > 3 * 12.5)
    page.select_option("#speed", "1")
    until(page, "lesson.now.controls.speed === 1")


def test_the_oracle_takes_over_and_gives_back(classroom: Classroom):
    page = classroom.page
    page.click("#oracle")
    until(page, "lesson.now.frame.by === 'oracle' && lesson.now.frame.instruction !== null")
    assert page.inner_text("#oracle") == "take over from the oracle"
    with key(page):
        until(page, "lesson.sent.at(-1).counted !== undefined")
        assert page.evaluate("lesson.now.frame.by") == "oracle"
    page.click("#oracle")
    until(page, "lesson.now.frame.by === 'nobody'")


def test_what_the_agent_says(classroom: Classroom):
    page = classroom.page
    clusters = page.evaluate("lesson.now.vocabulary.clusters")
    assert page.locator("#vocabulary li").count() == len(clusters) >= 2
    assert page.locator("#vocabulary li div").all_inner_texts() == [one["phrase"] for one in clusters]
    assert re.fullmatch(r"learnt at [\d,]+ frames, for 60 steps", page.inner_text("#learnt-at"))
    with paused_in_flight(page):  # so that it is about one moment
        said = page.evaluate("lesson.now.explanation")
        words = {one["phrase"] for one in clusters} | {"I do not know"}
        assert page.inner_text("#said") == said["said"]
        assert {said["said"]} <= words
        left = page.locator("#gauge-said").evaluate("one => parseFloat(one.style.left)")
        assert left == pytest.approx(50 + 50 * said["expression"], abs=0.01)
        with_path = page.evaluate(TEAL)
        page.evaluate("() => { lesson.now.explanation.path = null; }")
        until(page, f"({TEAL})() === 0")
        assert with_path > 0


def stands(page: Page) -> int:
    """Wait until the game makes no more steps, one may be under way; how many messages have been received."""
    seen: list[int] = [-1]

    def nothing_comes() -> bool:
        seen.append(page.evaluate("lesson.received"))
        time.sleep(0.3)
        return page.evaluate("lesson.received") == seen[-1]

    assert eventually(nothing_comes)
    return seen[-1]


@contextmanager
def paused_in_flight(page: Page) -> Iterator[None]:
    """Stop the game at a moment whose path is long enough to be seen."""
    for _ in range(20):  # the game may have ended before the pause counted
        until(page, PAUSED_IN_FLIGHT)
        until(page, "lesson.now.controls.paused")
        stands(page)
        flies = page.evaluate(IN_FLIGHT)
        try:
            if flies:
                yield
        finally:
            page.click("#pause")
            until(page, "!lesson.now.controls.paused")
        if flies:
            return
    pytest.fail("no flight was long enough")


def test_how_it_is_doing(classroom: Classroom):
    page = classroom.page
    assert re.fullmatch(r"\d+ %", page.inner_text("#success"))
    assert re.fullmatch(r"-?\d+", page.inner_text("#return"))
    assert re.fullmatch(r"[\d,]+ of 1,000,000", page.inner_text("#frames"))
    assert re.fullmatch(r"(no )?success, return -?\d+", page.inner_text("#last"))
    assert page.locator("#live-view").is_hidden()  # there is none


@pytest.mark.parametrize("size", [(1280, 720), (1366, 768), (1920, 1080)])
def test_it_fits_on_a_laptop(classroom: Classroom, size: tuple[int, int]):
    page = classroom.page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    until(page, f"document.documentElement.scrollWidth <= {size[0]}")
    until(page, f"document.documentElement.scrollHeight <= {size[1]}")
    boxes = [page.locator(one).bounding_box() for one in ("#stage", "#values", "#controls", "#how")]
    for above, below in pairwise(boxes):
        assert above is not None
        assert below is not None
        assert above["y"] + above["height"] <= below["y"] + 1


def test_a_second_page_watches_and_may_sit_down_later(classroom: Classroom):
    first = classroom.page
    second = opened(classroom.browser, classroom.training.address)
    assert second.inner_text("#seat") == "you watch, 2 pages are open"
    until(first, "document.getElementById('seat').textContent === 'you instruct, 2 pages are open'")
    assert second.locator("#sit").is_hidden()
    assert all(second.locator(one).is_disabled() for one in ("#pause", "#speed", "#oracle"))
    with key(second):
        time.sleep(0.2)
    assert second.evaluate("lesson.sent") == []
    first.goto("about:blank")  # gone in mid-flight
    second.click("#sit")
    until(second, "lesson.now.seat.instructs")
    with key(second):
        until(second, "lesson.now.frame.by === 'person' && lesson.now.frame.instruction === -1")
    second.close()
    first.goto(classroom.training.address)
    until(first, "lesson.now.seat && lesson.now.seat.instructs")


def test_the_training_is_killed(classroom: Classroom):
    """The last test of this training."""
    classroom.training.process.send_signal(signal.SIGKILL)
    until(classroom.page, "document.getElementById('notice').textContent.startsWith('The training process has ended.')")
    assert classroom.page.inner_text("#connection") == "over"


@pytest.fixture
def room() -> Iterator[Room]:
    with open_room() as made:
        yield made


def shown(browser: Browser, room: Room, **about: object) -> Page:
    """The page of a server beside which nothing trains."""
    room.server.post("about", {**ABOUT, "values": VALUES, "others_instructed_by": "oracle", **about})
    page = browser.new_page()
    page.goto(f"http://{HOST}:{room.port}/")
    until(page, "lesson.connected && lesson.now.about !== null && lesson.now.seat !== null")
    return page


def test_the_link_to_the_live_view(browser: Browser, room: Room):
    page = shown(browser, room, live_view=LIVE_VIEW)
    assert page.locator("#live-view").is_visible()
    assert page.get_attribute("#live-view", "href") == LIVE_VIEW
    page.close()


@pytest.mark.parametrize("width", [320, 390, 768])
def test_the_badges_do_not_overlap_on_a_phone(browser: Browser, room: Room, width: int):
    page = shown(browser, room, live_view=LIVE_VIEW)
    page.set_viewport_size({"width": width, "height": 844})
    texts = {"instruction": "a model of your habits +1", "episode": "game 1234, step 987, return -123"}
    for name, text in texts.items():
        page.evaluate(f"document.getElementById('{name}').textContent = '{text}'")
    until(page, f"document.documentElement.scrollWidth <= {width}")
    badges = [one.bounding_box() for one in page.locator(".pill:visible, .tag:visible, header > a:visible").all()]
    assert len(badges) >= 5
    for one, other in combinations(badges, 2):
        assert one is not None
        assert other is not None
        apart = [one[at] + one[long] <= other[at] or other[at] + other[long] <= one[at] for at, long in AXES]
        assert any(apart), (one, other)
    page.close()


def test_words_that_it_is_not_sure_of_are_grey_and_the_next_ones_are_not(browser: Browser, room: Room):
    page = shown(browser, room, live_view=None)
    said = {
        "said": "I do not know",
        "in_time": "",
        "expression": 0,
        "confidence": 0.3,
        "horizon_steps": 60,
        "path": None,
    }
    for known, colour in [(False, "rgb(154, 154, 168)"), (True, "rgb(45, 212, 191)")]:
        room.server.post("explanation", {**said, "episode": 0, "step": 0, "known": known})
        until(page, f"lesson.now.explanation && lesson.now.explanation.known === {str(known).lower()}")
        until(page, f"getComputedStyle(document.getElementById('said')).color === '{colour}'")
    page.close()


def test_a_word_whose_meaning_is_not_known_is_not_said(browser: Browser, room: Room):
    """No needle, no number, no word in the vocabulary; why is said instead."""
    page = shown(browser, room, live_view=None)
    why = "I cannot tell what “going right” means: the only evidence is what is rewarded (412 episodes)"
    cluster = {"id": 0, "expression": 0.9, "phrase": "I cannot tell", "share": 1.0, "colour": [1, 2, 3], "known": False}
    room.server.post("vocabulary", {"frame": 9, "horizon_steps": 60, "clusters": [cluster], "meaning": [why]})
    said = {"said": "I cannot tell", "in_time": "I cannot tell", "known": False, "meant": False, "path": None}
    room.server.post(
        "explanation", {**said, "expression": None, "confidence": None, "horizon_steps": 60, "episode": 0, "step": 0}
    )
    until(page, "document.getElementById('said').textContent === 'I cannot tell'")
    assert page.inner_text("#in-time") == page.inner_text("#meaning") == why
    assert page.locator("#gauge-said").is_hidden()
    assert page.inner_text("#sure") == ""
    assert page.locator("#vocabulary li span").all_inner_texts() == ["-", "100 %"]
    known = {**said, "said": "right", "in_time": "right", "known": True, "meant": True, "expression": 0.5}
    room.server.post("explanation", {**known, "confidence": None, "horizon_steps": 60, "episode": 0, "step": 1})
    until(page, "document.getElementById('said').textContent === 'right'")
    assert page.locator("#gauge-said").is_visible()
    assert page.inner_text("#sure") == ", for 60 steps"  # a confidence that is no probability is not shown
    page.close()


def test_two_frames_at_once_are_drawn_one_after_the_other_and_of_many_the_newest(browser: Browser, room: Room):
    page = shown(browser, room, live_view=None)
    room.server.post("scene", {"episode": 0, "size": [600, 400], "background": []})
    frame = {"episode": 0, "shapes": [], "at": None, "instruction": None, "by": "nobody", "heard": 0, "return": 0.0}
    until(page, "lesson.now.scene !== null")
    for together, drawn in [(2, 2), (40, 2)]:
        before = page.evaluate("lesson.drawn")
        frames = [{**frame, "step": step} for step in range(together)]
        page.evaluate("frames => { for (const one of frames) hear.frame(one); }", frames)
        until(page, f"document.getElementById('episode').textContent.startsWith('episode 1, step {together - 1},')")
        assert page.evaluate("lesson.drawn") == before + drawn
    page.close()


def test_it_says_that_the_connection_is_gone_and_connects_again(browser: Browser, room: Room):
    page = shown(browser, room, live_view=None)
    room.server.close()
    until(page, "!lesson.connected")
    assert page.inner_text("#connection") == "no connection"
    assert page.inner_text("#notice").startswith("No connection to the training")
    with key(page):
        pass
    assert page.evaluate("lesson.sent") == []
    assert page.locator("#pause").is_disabled()
    room.server = Server(room.desk, HOST, room.port)
    room.server.post("about", {**ABOUT, "values": VALUES, "others_instructed_by": "oracle", "live_view": None})
    until(page, "lesson.connected && lesson.now.seat !== null && lesson.now.seat.instructs")
    assert page.inner_text("#connection") == "connected"
    assert page.locator("#notice").is_hidden()
    with key(page):
        until(page, "lesson.sent.length === 1")
    page.close()


def test_the_farewell(browser: Browser, room: Room):
    page = shown(browser, room, live_view=None)
    room.server.post("farewell", {"text": "Training has ended."})
    room.server.close()
    until(page, "!lesson.connected")
    assert page.inner_text("#notice") == "Training has ended. The run is in the folder a run."
    assert page.inner_text("#connection") == "over"
    page.close()
