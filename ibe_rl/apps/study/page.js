"use strict";
// The pages of a study, one after the other, as the server says; an answer is confirmed before the next page shows.

const AGAIN_MS = [500, 1000, 2000, 4000, 8000];
const main = document.getElementById("main");
const taking = location.pathname.startsWith("/p/") ? location.pathname : null;
let about = { words: {} };
let hiddenMs = 0;
let hiddenSince = null;

const say = (name) => about.words[name] || name;

function make(kind, fields = {}, ...children) {
  const { data, ...plain } = fields;
  const one = Object.assign(document.createElement(kind), plain);
  Object.assign(one.dataset, data || {});
  one.append(...children.filter((child) => child !== null));
  return one;
}

document.addEventListener("visibilitychange", () => {
  if (document.hidden) hiddenSince = performance.now();
  else if (hiddenSince !== null) {
    hiddenMs += performance.now() - hiddenSince;
    hiddenSince = null;
  }
});

async function ask(path, body) {
  // Until there is a reply: a lost connection or a server that starts again loses nothing.
  for (let attempt = 0; ; attempt += 1) {
    try {
      const reply = await fetch(path, body === undefined ? {} : { method: "POST", body: JSON.stringify(body) });
      if (reply.status < 500) return { status: reply.status, ...(await reply.json()) };
    } catch (error) {
      if (!(error instanceof TypeError)) throw error; // the network, or no JSON
    }
    document.body.dataset.waits = "yes";
    await new Promise((ready) => setTimeout(ready, AGAIN_MS[Math.min(attempt, AGAIN_MS.length - 1)]));
    delete document.body.dataset.waits;
  }
}

function show(...children) {
  main.replaceChildren(...children);
  scrollTo(0, 0);
  main.focus({ preventScroll: true });
}

function buttons(...given) {
  return make("div", { className: "buttons" }, ...given);
}

async function begin() {
  const given = Object.fromEntries(new URLSearchParams(location.search));
  const field = make("input", { type: "text", id: "code", autocomplete: "off", value: given.code || "" });
  const label = make("label", { htmlFor: "code" }, say("your code"));
  const hint = make("p", { className: "hint", role: "alert" });
  const start = make("button", {}, say("begin"));
  start.onclick = async () => {
    start.disabled = true;
    const reply = await ask("/begin", about.recruiter === "codes" ? { ...given, code: field.value.trim() } : given);
    if (reply.address) return location.replace(reply.address);
    hint.textContent = say(reply.refused);
    start.disabled = false;
  };
  const code = about.recruiter === "codes" && !given.code ? [label, field] : [];
  show(make("h1", {}, about.title), ...code, buttons(start), hint);
}

function next(now) {
  const bar = document.getElementById("progress");
  bar.hidden = !("done" in now);
  Object.assign(bar, { max: now.of || 1, value: now.done || 0 });
  document.getElementById("withdraw").hidden = !("page" in now);
  if (!("page" in now)) return end(now);
  hiddenMs = 0;
  const shown = { trial, consent, comment }[now.kind] || questions;
  shown(now, performance.now());
}

async function answer(now, since, value) {
  for (const one of main.querySelectorAll("button, input, textarea")) one.disabled = true;
  const reply = await ask(`${taking}/answer`, {
    page: now.page,
    attempt: now.attempt,
    value,
    took_ms: Math.round(performance.now() - since),
    hidden_ms: Math.round(hiddenMs),
  });
  return reply;
}

function text(now) {
  return make("section", { innerHTML: now.html || "" }); // made by the server, which lets no HTML of a text through
}

function consent(now, since) {
  const yes = make("button", {}, say("I agree"));
  const no = make("button", { className: "quiet" }, say("I do not agree"));
  yes.onclick = async () => next((await answer(now, since, { agrees: true })).now);
  no.onclick = async () => next((await answer(now, since, { agrees: false })).now);
  show(text(now), buttons(yes, no));
}

function comment(now, since) {
  const field = make("textarea", { rows: 6, id: "comment", maxLength: 2000 });
  const on = make("button", {}, say("next"));
  on.onclick = async () => next((await answer(now, since, { text: field.value })).now);
  show(make("label", { htmlFor: "comment" }, say("anything else?")), field, buttons(on));
}

function questions(now, since) {
  const chosen = now.questions.map((one) => (one.options.length ? null : one.optional ? null : ""));
  const on = make("button", {}, say("next"));
  const ready = () => {
    on.disabled = !now.questions.every((one, index) => one.optional || (chosen[index] !== null && chosen[index] !== ""));
  };
  const asked = now.questions.map((one, index) => {
    const take = (value) => {
      chosen[index] = value;
      ready();
    };
    return make("fieldset", {}, make("legend", {}, one.text), ...(one.options.length ? choices(one, index, take) : [written(take)]));
  });
  const value = now.kind === "attention" ? () => ({ choice: chosen[0] }) : () => (asked.length ? { choices: chosen } : {});
  on.onclick = async () => next((await answer(now, since, value())).now);
  show(text(now), ...asked, buttons(on));
  ready();
}

function choices(question, index, take) {
  return question.options.map((option, place) => {
    const button = make("input", { type: "radio", name: `question-${index}`, onchange: () => take(place) });
    return make("label", { className: "option" }, button, option);
  });
}

function written(take) {
  return make("input", { type: "text", maxLength: 2000, oninput: (event) => take(event.target.value) });
}

async function trial(now, since) {
  const { said } = now.episode;
  const landing = now.task === "landing";
  const value = landing ? { at: null } : { choice: null };
  if (now.confidence) value.confidence = null;
  const on = make("button", { disabled: true }, say("next"));
  const hint = make("p", { className: "hint" }, say("watch"));
  const ready = () => {
    on.disabled = Object.values(value).some((one) => one === null);
  };
  const words = make("p", { className: "words" });
  const needle = make("i");
  const canvas = make("canvas", { role: "img", ariaLabel: say("the episode") });
  const asked = make("div", { hidden: true });
  show(said ? make("div", { className: "said" }, words, make("div", { className: "gauge" }, needle)) : make("div", { className: "said" }), canvas, hint, asked, buttons(on));
  const episode = new Episode(canvas, now.episode, {
    playing: (frame) => {
      if (!said) return;
      words.textContent = said.phrases[frame];
      needle.style.left = `${50 + 50 * Math.max(-1, Math.min(1, said.expressions[frame]))}%`;
    },
    chosen: landing
      ? (place) => {
          value.at = place;
          ready();
        }
      : null,
  });
  await episode.play();
  hint.textContent = say(landing ? "where will it land?" : "what comes next?");
  asked.hidden = false;
  if (!landing) {
    asked.append(make("fieldset", {}, ...choices(now.questions[0], 0, (place) => {
      value.choice = place;
      ready();
    })));
  }
  if (now.confidence) {
    asked.append(sure((percent) => {
      value.confidence = percent;
      ready();
    }));
  }
  if (landing) canvas.focus({ preventScroll: true });
  on.onclick = async () => {
    const reply = await answer(now, since, value);
    if (reply.feedback) await lookBack(episode, reply.feedback, now, hint, on);
    episode.close();
    next(reply.now);
  };
}

function sure(take) {
  const output = make("output", {}, "–");
  const slider = make("input", { type: "range", min: 0, max: 100, step: 1, value: 50, id: "confidence" });
  slider.oninput = () => {
    output.textContent = `${slider.value} %`;
    take(Number(slider.value));
  };
  return make("div", {}, make("label", { htmlFor: "confidence" }, say("how sure are you?")), make("div", { className: "range" }, slider, output));
}

async function lookBack(episode, feedback, now, hint, on) {
  hint.textContent = say("this is what happened");
  if ("at" in feedback.truth && now.task === "landing") episode.truth = feedback.truth.at;
  else hint.textContent += ` ${now.questions[0].options[feedback.truth.choice]}`;
  episode.done = false;
  if (feedback.frames.length) await episode.play(feedback.frames);
  episode.draw();
  on.disabled = false;
  on.focus();
  await new Promise((clicked) => {
    on.onclick = clicked;
  });
}

function end(now) {
  const parts = [make("h1", {}, say(`ended: ${now.ended}`))];
  if (now.code) parts.push(make("p", {}, say("your completion code")), make("p", { className: "code" }, now.code));
  if (now.address) {
    const back = make("button", {}, say("go back"));
    back.onclick = () => location.assign(now.address);
    parts.push(buttons(back));
  }
  show(...parts);
}

function offerWithdrawal() {
  const dialog = document.getElementById("leaving");
  const [no, yes] = dialog.querySelectorAll("button");
  document.getElementById("leaving-text").textContent = say("withdraw and delete?");
  [no.textContent, yes.textContent] = [say("go on"), say("withdraw")];
  const button = document.getElementById("withdraw");
  button.textContent = say("withdraw");
  button.onclick = () => dialog.showModal();
  dialog.onclose = async () => {
    if (dialog.returnValue === "yes") next(await ask(`${taking}/withdraw`, {}));
  };
}

async function open() {
  about = await ask("/about");
  document.title = about.title;
  document.documentElement.lang = about.language;
  document.getElementById("contact").textContent = about.contact;
  if (!taking) return begin();
  offerWithdrawal();
  const now = await ask(`${taking}/now`);
  if (now.status === 404) return end({ ended: "unknown" });
  next(now);
}

open();
