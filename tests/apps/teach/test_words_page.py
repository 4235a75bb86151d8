"""The page with words of one's own, its outcomes and its summary, in a real browser; nothing trains beside it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from browsers import browsing
from clients import HOST, VALUES, Room, eventually, open_room
from pages import until
from playwright.sync_api import Browser, Page

from ibe_rl.apps.teach.messages import Wrong
from ibe_rl.apps.teach.server import words_fields
from ibe_rl.apps.teach.session import Said
from ibe_rl.task.words import Words

ABOUT = {"name": "a game", "run": "a run", "total_frames": 1_000, "hold_steps": 0, "others": 0, "oracle": False}
SQUARE = {"points": [[0, 0], [9, 0], [9, 9]], "colour": [200, 100, 50], "closed": True}
WHATEVER = "document.getElementById('whatever').textContent === 'whatever you say now: halt'"
NOTHING = "document.getElementById('whatever').textContent === ''"
SAID = {
    "said": "links",
    "in_time": "links",
    "known": True,
    "meant": True,
    "confidence": None,
    "horizon_steps": 60,
    "expression": None,
    "path": [[100, 300], [300, 200]],
    "episode": 0,
    "step": 3,
}


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with browsing() as opened:
        yield opened


@pytest.fixture
def room() -> Iterator[Room]:
    with open_room(Words(["links", "halt", "יָמִינָה"], 12), lambda text, _: 0 if "links" in text else None) as made:
        yield made


@pytest.fixture
def page(browser: Browser, room: Room) -> Iterator[Page]:
    room.server.post("about", {**ABOUT, "values": VALUES, "others_instructed_by": "habits", "live_view": None})
    room.server.post("words", words_fields(room.desk.words))
    room.server.post("scene", {"episode": 0, "size": [600, 400], "background": []})
    opened = browser.new_page(viewport={"width": 1280, "height": 720})
    opened.goto(f"http://{HOST}:{room.port}/")
    until(opened, "lesson.connected && lesson.now.words && lesson.now.scene && lesson.now.seat")
    yield opened
    opened.close()


def says(room: Room, slot: int | None) -> None:
    """Wait until the desk has that word, or none."""
    said: list[Said] = []

    def has() -> bool:
        said.append(room.desk.take())
        return said[-1].value == slot

    assert eventually(has), said[-1]


@pytest.mark.parametrize(("key", "slot"), [("1", 0), ("3", 2), ("ArrowDown", 1), ("ArrowRight", 2)])
def test_a_key_says_a_word(page: Page, room: Room, key: str, slot: int):
    page.keyboard.down(key)
    says(room, slot)
    assert page.evaluate("lesson.sent.at(-1).value") == room.desk.words.names[slot]
    page.keyboard.up(key)
    says(room, None)


def test_a_finger_says_the_word_of_a_button_and_of_its_part_of_the_picture(page: Page, room: Room):
    for place in ("#values button:nth-child(2)", None):
        box = page.locator(place or "#stage").bounding_box()
        assert box is not None
        finger = {"x": box["x"] + box["width"] / 2, "y": box["y"] + 0.3 * box["height"]}
        session = page.context.new_cdp_session(page)
        session.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [finger]})
        says(room, 1)
        session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        says(room, None)


def test_a_word_is_renamed_and_one_is_added(page: Page, room: Room):
    named: list[tuple[str, ...]] = []
    room.server.renamed = lambda: named.append(room.desk.words.names)
    page.click("#naming summary")
    page.fill("#names input:nth-child(1)", "左へ")
    page.keyboard.press("Enter")
    until(page, "document.querySelector('#values button').dataset.value === '左へ'")
    page.fill("#names input:nth-child(4)", "faster")
    page.keyboard.press("Enter")
    until(page, "document.querySelectorAll('#values button').length === 4")
    assert room.desk.words.names == ("左へ", "halt", "יָמִינָה", "faster")
    assert named[-1] == room.desk.words.names
    page.keyboard.down("4")
    says(room, 3)
    page.keyboard.up("4")


def test_a_digit_in_a_field_is_no_instruction_and_a_name_that_is_taken_is_refused(page: Page, room: Room):
    page.click("#naming summary")
    page.fill("#names input:nth-child(1)", "HALT")
    page.keyboard.press("2")
    page.keyboard.press("Backspace")
    page.keyboard.press("Enter")
    until(page, "document.getElementById('refused').textContent.includes('it is there already')")
    assert page.input_value("#names input:nth-child(1)") == "links"
    assert page.evaluate("lesson.sent") == []
    assert room.desk.words.names[0] == "links"


def test_a_typed_text_is_a_word(page: Page, room: Room):
    page.fill("#typed", "Halt")
    page.keyboard.press("Enter")
    says(room, 1)
    says(room, None)
    page.fill("#typed", "etwas langsamer")
    page.keyboard.press("Enter")
    says(room, 3)
    assert room.desk.words.names[3] == "etwas langsamer"


def test_a_typed_text_that_says_a_word_is_shown_and_can_be_corrected(page: Page, room: Room):
    page.fill("#typed", "mehr nach links")
    page.keyboard.press("Enter")
    says(room, 0)
    assert page.locator("#values button.on").get_attribute("data-value") == "links"
    page.click("#naming summary")
    assert page.inner_text("#phrases li bdi") == "mehr nach links"
    page.select_option("#phrases select", label="halt")
    until(page, "lesson.now.words.phrases[1].length === 1")
    page.fill("#typed", "Mehr nach links")
    page.keyboard.press("Enter")
    says(room, 1)
    says(room, None)
    page.fill("#names input:nth-child(1)", "左へ")
    page.keyboard.press("Enter")
    until(page, "lesson.now.words.words[0] === '左へ'")
    page.select_option("#phrases select", label="a word of its own")
    until(page, "document.querySelectorAll('#values button').length === 4")
    assert page.locator("#phrases").is_hidden()
    assert room.desk.words.names[3] == "mehr nach links"


def test_what_became_of_an_explanation_and_that_it_was_wrong(page: Page, room: Room):
    room.server.post("outcome", {"episode": 0, "step": 3, "said": "links", "went": "halt", "came_true": False})
    until(page, "lesson.now.outcome !== null")
    assert page.inner_text("#came") == "It said: links. It went: halt."
    page.click("#wrong")
    until(page, "document.getElementById('wrong').textContent === 'noted'")
    marks: list[Wrong | None] = []
    assert eventually(lambda: marks.append(room.desk.take().wrong) or marks[-1] is not None)
    assert marks[-1] == Wrong(0, 3)
    assert page.evaluate("lesson.sent") == []  # it is no instruction


def test_what_it_would_do_if_it_were_told_otherwise(page: Page, room: Room):
    frame = {"episode": 0, "step": 3, "shapes": [], "at": None, "instruction": 0, "word": "links", "by": "person"}
    room.server.post("frame", {**frame, "heard": 0, "return": 0.0})
    shares = [["links", 0.7], ["halt", 0.2], ["יָמִינָה", 0.1]]
    answers: list[dict[str, Any]] = [
        {"told": word, "said": "halt", "path": [[300, 300], [300 + 200 * way, 100]]}
        for way, (word, _) in zip((-1, 0, 1), shares, strict=True)
    ]
    asked = {**SAID, "shares": shares, "what_if": answers, "whatever": "halt", "listens": 0.1}
    room.server.post("explanation", {**asked, "said": "halt"})
    until(page, WHATEVER)
    until(page, "document.getElementById('instruction').textContent === 'you say links'")
    assert page.locator("#shares li").count() == 3
    assert page.locator("#gauge").is_hidden()
    painted = """() => {
      const canvas = document.getElementById("canvas");
      const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height / 2).data;
      return pixels.some((one) => one > 0);
    }"""
    until(page, f"({painted})()")


def test_what_it_does_whatever_it_is_told_is_said_only_while_it_says_the_same(page: Page, room: Room):
    shares = [["links", 0.7], ["halt", 0.2], ["יָמִינָה", 0.1]]
    answers = [{"told": word, "said": "halt", "path": None} for word, _ in shares]
    asked = {**SAID, "said": "halt", "shares": shares, "what_if": answers, "whatever": "halt", "listens": 0.1}
    between = {**asked, "what_if": [], "whatever": None, "listens": None}
    for message, expected in (
        (asked, WHATEVER),
        (between, WHATEVER),
        ({**between, "said": "links"}, NOTHING),
        (asked, WHATEVER),
        ({**asked, "said": "links"}, NOTHING),
        (asked, WHATEVER),
    ):
        room.server.post("explanation", message)
        until(page, f"{expected} && lesson.now.explanation.said === '{message['said']}'")
    room.server.post("scene", {"episode": 1, "size": [600, 400], "background": []})
    until(page, NOTHING)


def test_the_lesson_in_sum(page: Page, room: Room):
    film = {"said": "links", "went": "links", "came_true": True, "size": [600, 400], "background": [SQUARE]}
    summary = {
        "episodes": 3,
        "marked": 1,
        "consistency": 0.834,
        "understood": "I understand 'links'.",
        "words": [{"word": "links", "said_steps": 40, "in_good_episodes": 9}],
        "meaning": ["“links”: x falls"],
        "films": [{**film, "pictures": [[SQUARE], [SQUARE]]}],
    }
    room.server.post("summary", summary)
    until(page, "!document.getElementById('summary').hidden")
    text = page.inner_text("#summary")
    for part in ("in 3 episodes", "At 83 % of the steps", "1 explanation wrong", "“links”: x falls", "came true"):
        assert part in text
    assert page.locator("#summary canvas").count() == 1


@pytest.mark.parametrize("width", [360, 1280])
def test_it_fits_with_twelve_words(page: Page, room: Room, width: int):
    page.set_viewport_size({"width": width, "height": 720})
    words = [*room.desk.words.names, *(f"word number {one}" for one in range(4, 13))]
    room.server.post("words", words_fields(Words(words)))
    room.server.post("understood", {"text": "I understand 'links'. " * 8})
    until(page, "document.querySelectorAll('#values button').length === 12")
    until(page, f"document.documentElement.scrollWidth <= {width}")
