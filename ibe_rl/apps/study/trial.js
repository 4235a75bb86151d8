"use strict";
// A trial: recordings play, a question is answered, and what really happened may be shown.

const FEEDBACK = `study/feedback${location.pathname}${location.search}`; // of this tab and person
const ASKS = { landing: "ask_landing", next_words: "ask_next_words", what_if: "ask_what_if", which_agent: "ask_which_agent" };

const asks = (task, [{ told }]) => say(ASKS[task]).replace("{told}", told);

function staged(recordings) {
  // One recording, or two side by side with their names.
  const several = recordings.length > 1;
  const names = ["first", "second"];
  const shown = recordings.map((one, index) => new Recording(one, say(several ? names[index] : "picture")));
  const figures = shown.map((one, index) => make("figure", {}, several ? make("figcaption", {}, say(names[index])) : null, one.element));
  return { shown, stage: make("div", { className: several ? "stage pair" : "stage" }, ...figures) };
}

async function playAll(shown) {
  // One after the other, on wide and on narrow screens alike: nobody can watch two at once.
  for (const one of shown) {
    one.element.scrollIntoView({ block: "nearest" });
    await one.play();
  }
}

function exampleOf(recordings) {
  const { shown, stage } = staged(recordings);
  const play = makeButton("play", say("play"));
  play.onclick = async () => {
    play.disabled = true;
    await playAll(shown);
    play.disabled = false;
  };
  const told = recordings[0].told ? make("p", { className: "asked" }, asks("what_if", recordings)) : null;
  return make("section", { className: "example" }, make("p", { className: "badge" }, say("example")), told, stage, inRow(play));
}

async function trial(now) {
  const { shown, stage } = staged(now.recordings);
  const play = makeButton("play", say("play"));
  const below = make("div", { id: "below" }, make("p", { className: "hint" }, say("watch")), inRow(play));
  const foretold = now.task === "what_if"; // what it is told has to be known before the words of the clip are read
  show(make("h1", { className: foretold ? "asked" : "unseen" }, asks(now.task, now.recordings)), badgeOf(now), stage, below);
  const phase = (name) => (document.body.dataset.phase = name);
  phase("ready");
  play.focus({ preventScroll: true });
  await clicked(play);
  if (document.body.dataset.page !== now.page) return; // withdrawn meanwhile
  phase("playing");
  play.disabled = true;
  await playAll(shown);
  if (document.body.dataset.page !== now.page) return;
  startClock();
  const { value, on } = askAbout(now, shown[0], below);
  phase("asked");
  on.onclick = async () => {
    if (isLeftOut(value)) return;
    on.onclick = null;
    const reply = await send(now, value);
    if (reply.feedback) {
      const seen = { now, feedback: reply.feedback, value };
      keepFeedback(seen);
      await lookBack(seen, shown[0], below);
    }
    next(reply.now);
  };
}

// Feedback is kept until they go on from it: a reload shows it again. A browser that stores nothing goes on without it.
function keepFeedback(seen) {
  try {
    sessionStorage.setItem(FEEDBACK, JSON.stringify(seen));
  } catch {}
}

function keptFeedback() {
  try {
    return JSON.parse(sessionStorage.getItem(FEEDBACK));
  } catch {
    return null;
  }
}

async function lookBackAgain() {
  const seen = keptFeedback();
  if (!seen) return;
  const { shown, stage } = staged(seen.now.recordings);
  const below = make("div", { id: "below" });
  for (const name of ["page", "kind", "attempt"]) document.body.dataset[name] = seen.now[name];
  show(badgeOf(seen.now), stage, below);
  await lookBack(seen, shown[0], below);
}

const badgeOf = (now) => (["practice", "transfer"].includes(now.block) ? make("p", { className: "badge" }, say(now.block)) : null);

function askAbout(now, recording, below) {
  const landing = now.task === "landing";
  const value = landing ? { at: null } : { choice: null };
  const take = (name) => (given) => {
    value[name] = given;
    document.getElementById("missing").textContent = "";
  };
  const parts = [];
  if (landing) {
    recording.askPlace(say("ask_landing"), take("at"));
    parts.push(make("p", { className: "asked" }, say("ask_landing")), make("p", { className: "hint" }, say("how_landing")));
  } else parts.push(questionOf({ ...now.questions[0], text: asks(now.task, now.recordings) }, 0, now.kind, take("choice")));
  if (now.confidence) {
    value.confidence = null;
    const percent = slider({ id: "confidence", max: 100 }, say("confidence_low"), say("confidence_high"), (given) => `${given} %`, take("confidence"));
    parts.push(make("div", {}, make("label", { htmlFor: "confidence", className: "asked" }, say("confidence")), percent));
  }
  const on = makeButton("next", say("next"));
  below.replaceChildren(...parts, alertLine(), inRow(on));
  (landing ? recording.canvas : below.querySelector("input")).focus({ preventScroll: true });
  return { value, on };
}

function isLeftOut(value) {
  const left = Object.values(value).includes(null);
  document.getElementById("missing").textContent = left ? say("choose") : "";
  return left;
}

async function lookBack({ now, feedback, value }, recording, below) {
  document.body.dataset.phase = "feedback";
  const on = makeButton("next", say("next"));
  const left = clicked(on); // also while it still plays
  const line = (kind, text) => make("p", { className: `key ${kind}` }, now.task === "landing" ? make("i") : null, text);
  const named = (choice) => (now.questions.length ? `: ${now.questions[0].options[choice]}` : "");
  const keys = [line("true", say("true_answer") + named(feedback.choice)), line("chosen", say("your_answer") + named(value.choice))];
  below.replaceChildren(make("div", { id: "feedback", role: "status" }, make("p", { className: "asked" }, say("happened")), ...keys), inRow(on));
  main.inert = false;
  recording.chosen = null;
  if (feedback.frames.length) {
    recording.element.scrollIntoView({ block: "nearest" });
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    await Promise.race([left, recording.play(still ? feedback.frames.slice(-1) : feedback.frames, null)]);
  }
  if (now.task === "landing") recording.truth = feedback.at;
  recording.draw();
  on.focus({ preventScroll: true });
  await left;
  keepFeedback(null);
}
