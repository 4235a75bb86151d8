"use strict";
// The pages of a study, one after the other, as the server (or bundle.js) says; an answer is confirmed before the next page shows.
//
// What others may rely on (programs that walk through a study, style sheets):
//   body[data-page], body[data-kind], body[data-attempt]   the page that is shown, as the server names it; body[data-ended] at the end
//   body[data-phase]   of a trial: ready, playing, asked, feedback; elsewhere absent. A reload during feedback shows it again
//   #begin #code       the first page: its button, and the field for a one-time code
//   #agree #disagree   consent
//   #play              starts a trial's recording or the example
//   #place             canvas of a landing trial once it is asked: click, drag, or arrow keys
//   #confidence        slider 0 to 100
//   #next              confirms a page, and goes on after feedback
//   #comment           free text
//   .question          one for each question, in order; in it .option input[type=radio][value=N], or input.many[type=range], or input[type=text]
//   #missing           says that something is not answered yet
//   #feedback          what really happened
//   #withdraw #withdraw-yes #withdraw-no   leave and delete
//   #waiting           shown while there is no connection
//   #completion-code #go-back              at the end

const AGAIN_MS = [500, 1000, 2000, 4000, 8000];
const PATIENCE_MS = 15000;
const MOST_MS = 6 * 24 * 3600 * 1000;
const MOST_CHARACTERS = 2000;
const MOST_RADIOS = 11; // more options are a slider
const main = document.getElementById("main");
const waiting = document.getElementById("waiting");
const bundle = window.studyBundle || null; // what takes the server's place where there is none, see bundle.js
const taking = bundle ? bundle.address : location.pathname.startsWith("/p/") ? location.pathname : null;
let about = { words: {} };
let clock = { since: 0, hiddenMs: 0, hiddenSince: null };

const say = (name) => about.words[name] || name;

function make(kind, fields = {}, ...children) {
  const one = Object.assign(document.createElement(kind), fields);
  one.append(...children.filter((child) => child !== null));
  return one;
}

const makeButton = (id, text, quiet = false) => make("button", { id, type: "button", className: quiet ? "quiet" : "" }, text);
const clicked = (button) => new Promise((done) => button.addEventListener("click", done, { once: true }));

document.addEventListener("visibilitychange", () => {
  if (document.hidden) clock.hiddenSince = performance.now();
  else if (clock.hiddenSince !== null) {
    clock.hiddenMs += performance.now() - clock.hiddenSince;
    clock.hiddenSince = null;
  }
});

function startClock() {
  const now = performance.now();
  clock = { since: now, hiddenMs: 0, hiddenSince: document.hidden ? now : null };
}

// A key that is held confirms one page, not all that follow.
addEventListener("keydown", (event) => {
  if (event.repeat && event.key === "Enter") event.preventDefault();
});

const ask = (path, body) => (bundle ? bundle.ask(path, body) : reach(path, body, ofServer));
const ofServer = async (reply) => (reply.status < 500 ? { status: reply.status, ...(await reply.json()) } : null);

async function reach(path, body, read) {
  // Until there is a reply: a lost connection or a server that starts again loses nothing.
  for (let attempt = 0; ; attempt += 1) {
    try {
      const sent = body === undefined ? {} : { method: "POST", body: JSON.stringify(body) };
      const reply = await fetch(path, { ...sent, signal: AbortSignal.timeout(PATIENCE_MS) });
      const given = await read(reply);
      if (given) {
        waiting.hidden = true;
        return given;
      }
    } catch {
      // no connection, no reply in time, or a reply of something that is not this server
    }
    waiting.textContent = about.words.waiting || "…";
    waiting.hidden = false;
    await pause(AGAIN_MS[Math.min(attempt, AGAIN_MS.length - 1)]);
  }
}

function pause(ms) {
  return new Promise((over) => {
    setTimeout(over, ms);
    addEventListener("online", over, { once: true });
  });
}

function show(...children) {
  main.replaceChildren(...children.filter((child) => child !== null));
  main.inert = false;
  scrollTo(0, 0);
  main.focus({ preventScroll: true });
}

const inRow = (...given) => make("div", { className: "buttons" }, ...given);
const alertLine = () => make("p", { id: "missing", className: "alert", role: "alert" });
const ownText = (now) => make("section", { innerHTML: now.html }); // the server lets no HTML of a text through

async function begin() {
  const given = Object.fromEntries(new URLSearchParams(location.search));
  const asks = about.recruiter === "codes" && !given.code;
  const field = make("input", { type: "text", id: "code", autocomplete: "off", autocapitalize: "off", spellcheck: false });
  const why = alertLine();
  const start = makeButton("begin", say("begin"));
  const form = make("form", {}, asks ? make("label", { htmlFor: "code" }, say("your_code")) : null, asks ? field : null, inRow(start), why);
  start.type = "submit";
  form.onsubmit = async (event) => {
    event.preventDefault();
    start.disabled = true;
    const reply = await ask("/begin", asks ? { ...given, code: field.value.trim() } : given);
    if (reply.address) return location.replace(reply.address);
    why.textContent = say(reply.refused);
    start.disabled = false;
  };
  show(make("h1", {}, about.title), form);
  (asks ? field : start).focus();
}

function next(now) {
  const under = "page" in now;
  for (const name of ["page", "kind", "attempt", "ended"]) {
    if (name in now) document.body.dataset[name] = now[name];
    else delete document.body.dataset[name];
  }
  delete document.body.dataset.phase;
  const bar = document.getElementById("progress");
  bar.hidden = !under;
  Object.assign(bar, { max: now.of || 1, value: now.done || 0 });
  document.getElementById("step").textContent = under ? `${now.done + 1} / ${now.of}` : "";
  document.getElementById("withdraw").hidden = !taking || ["withdrawn", "unknown"].includes(now.ended);
  startClock();
  if (!under) return end(now);
  ({ trial, consent, comment, instructions }[now.kind] || questions)(now);
}

async function send(now, value) {
  main.inert = true;
  const passed = { took_ms: performance.now() - clock.since, hidden_ms: clock.hiddenMs };
  for (const name in passed) passed[name] = Math.min(MOST_MS, Math.round(passed[name]));
  const reply = await ask(`${taking}/answer`, { page: now.page, attempt: now.attempt, value, ...passed });
  return reply.now ? reply : { now: await current() };
}

async function current() {
  const reply = await ask(`${taking}/now`);
  return reply.status === 200 ? reply : { ended: "unknown" };
}

const goOn = async (now, value) => next((await send(now, value)).now);

function consent(now) {
  const [yes, no] = [makeButton("agree", say("agree")), makeButton("disagree", say("disagree"), true)];
  yes.onclick = () => goOn(now, { agrees: true });
  no.onclick = () => goOn(now, { agrees: false });
  show(ownText(now), inRow(yes, no));
}

function instructions(now) {
  const again = now.attempt > 1 ? make("p", { className: "notice" }, say("comprehension_again")) : null;
  const on = makeButton("next", say("next"));
  on.onclick = () => goOn(now, {});
  show(again, ownText(now), now.recordings ? exampleOf(now.recordings) : null, inRow(on));
}

function comment(now) {
  const field = make("textarea", { rows: 6, id: "comment", maxLength: MOST_CHARACTERS });
  const on = makeButton("next", say("next"));
  on.onclick = () => goOn(now, { text: field.value });
  show(make("h1", {}, say("heading_comment")), make("label", { htmlFor: "comment" }, say("comment")), field, inRow(on));
}

function questions(now) {
  const chosen = now.questions.map(() => null);
  const on = makeButton("next", say(now.kind === "debriefing" ? "finish" : "next"));
  const missing = alertLine();
  const take = (index) => (value) => {
    chosen[index] = value;
    if (asked[index].classList.contains("left-out")) missing.textContent = "";
    asked[index].classList.remove("left-out");
  };
  const asked = now.questions.map((one, index) => questionOf(one, index, now.kind, take(index)));
  on.onclick = () => {
    const left = now.questions.findIndex((one, index) => !one.optional && chosen[index] === null);
    asked.forEach((one, index) => one.classList.toggle("left-out", index === left));
    if (left < 0) return goOn(now, now.kind === "attention" ? { choice: chosen[0] } : asked.length ? { choices: chosen } : {});
    missing.textContent = say("choose");
    asked[left].querySelector("input").focus();
  };
  const heading = now.html ? ownText(now) : make("h1", {}, say(`heading_${now.kind}`));
  show(heading, now.lead ? make("p", {}, now.lead) : null, ...asked, missing, inRow(on));
}

function questionOf(one, index, kind, take) {
  const mark = one.optional ? make("span", { className: "hint" }, ` (${say("optional")})`) : null;
  const field = !one.options.length ? written(take) : one.options.length > MOST_RADIOS ? many(one.options, take) : choices(one.options, index, kind, take);
  return make("fieldset", { className: "question" }, make("legend", {}, one.text, mark), field);
}

function choices(options, index, kind, take) {
  const labels = options.map((option, place) => {
    const input = make("input", { type: "radio", name: `question-${index}`, value: place, onchange: () => take(place) });
    return make("label", { className: "option" }, input, make("span", {}, option));
  });
  return make("div", { className: kind === "scale" ? "options in-a-row" : "options" }, ...labels);
}

function written(take) {
  return make("input", { type: "text", maxLength: MOST_CHARACTERS, oninput: (event) => take(event.target.value.trim() || null) });
}

function many(options, take) {
  return slider({ className: "many", max: options.length - 1 }, options[0], options[options.length - 1], (place) => options[place], take);
}

function slider(fields, low, high, wording, take) {
  const output = make("output", {}, "–");
  const input = make("input", { type: "range", min: 0, step: 1, ...fields });
  input.value = Math.round(input.max / 2);
  input.classList.add("untouched");
  const set = () => {
    input.classList.remove("untouched");
    output.textContent = wording(Number(input.value));
    take(Number(input.value));
  };
  input.oninput = set;
  input.onpointerup = set; // the middle can be chosen as well
  input.onkeyup = (event) => (event.key === " " || event.key === "Enter" ? set() : null);
  return make("div", { className: "slider" }, input, output, make("span", { className: "low" }, low), make("span", { className: "high" }, high));
}

function end(now) {
  const parts = [make("h1", {}, say(`ended_${now.ended}`))];
  if (now.code) parts.push(make("p", {}, say("completion_code")), make("p", { id: "completion-code" }, now.code));
  if (now.address) {
    const back = makeButton("go-back", say("go_back"));
    back.onclick = () => location.assign(now.address);
    parts.push(inRow(back));
  }
  show(...parts);
}

function offerWithdrawal() {
  const dialog = document.getElementById("leaving");
  const texts = { withdraw: "withdraw", "leaving-text": "withdraw_question", "withdraw-no": "withdraw_no", "withdraw-yes": "withdraw_yes" };
  for (const id in texts) document.getElementById(id).textContent = say(texts[id]);
  document.getElementById("withdraw").onclick = () => {
    dialog.returnValue = "no";
    dialog.showModal();
  };
  dialog.onclose = async () => {
    if (dialog.returnValue !== "yes") return;
    keepFeedback(null);
    await ask(`${taking}/withdraw`, {});
    next({ ended: "withdrawn" }); // also if the first try reached the server and its reply did not come back
  };
}

async function start() {
  about = await ask("/about");
  document.title = about.title;
  document.documentElement.lang = about.language;
  document.getElementById("contact").textContent = about.contact;
  document.getElementById("progress").ariaLabel = say("progress");
  if (!taking) return begin();
  offerWithdrawal();
  await lookBackAgain();
  next(await current());
}

start();
