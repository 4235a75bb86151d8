"use strict";
// The page of the lesson. What the server says is kept in `now`, and drawn at the next frame of the screen.

const now = {
  about: null, words: null, scene: null, frame: null, explanation: null, otherwise: null, outcome: null, understood: null,
  vocabulary: null, figures: null, seat: null, controls: null, summary: null,
};
// What a test of the page looks at: what was sent, and how much came and was drawn.
const lesson = { now, sent: [], received: 0, drawn: 0, rate: 0, connected: false, waits: [] };
window.lesson = lesson;

const at = (id) => document.getElementById(id);
const signed = (value) => (value > 0 ? "+" : value < 0 ? "−" : "") + Math.abs(value);
const percent = (value) => `${Math.round(100 * value)} %`;

// ---- the connection

let socket = null;
let sequence = 0;
let pauseBeforeRetry = 250;
let over = false;

function connect() {
  socket = new WebSocket(`ws://${location.host}/lesson`);
  socket.onopen = () => {
    sequence = 0;
    pauseBeforeRetry = 250;
    lesson.connected = true;
    show("connection", "connected", "pill good");
    notice(null);
    say.again();
  };
  socket.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (hear[message.kind]) hear[message.kind](message);
  };
  socket.onclose = (event) => {
    lesson.connected = false;
    now.seat = null;
    enable();
    if (over) return;
    show("connection", "no connection", "pill bad");
    const why = event.reason ? ` (${event.reason})` : "";
    notice(`No connection to the training${why}. Your input does not reach it. Trying again…`);
    setTimeout(connect, pauseBeforeRetry);
    pauseBeforeRetry = Math.min(4000, 2 * pauseBeforeRetry);
  };
}

function send(message) {
  if (!socket || socket.readyState !== WebSocket.OPEN) return;
  socket.send(JSON.stringify(message));
}

// ---- what the person says: the newest of all that is held down counts

const held = []; // [{source, value}], the newest last
const say = {
  saying: null, // value, while something is held down
  episode: -1, // that it was said in
  press(source, value) {
    if (held.some((one) => one.source === source)) return;
    held.push({ source, value });
    say.now();
  },
  release(source) {
    const index = held.findIndex((one) => one.source === source);
    if (index >= 0) held.splice(index, 1);
    say.now();
  },
  releaseAll() {
    held.length = 0;
    say.now();
  },
  // An instruction is about the episode that is seen: in a new one it is said again while the key is still down.
  now() {
    const value = held.length ? held[held.length - 1].value : null;
    const episode = now.scene ? now.scene.episode : 0;
    if (now.seat && now.seat.instructs && (value !== say.saying || (value !== null && episode !== say.episode))) {
      sequence += 1;
      const message = value === null ? { kind: "release", sequence, episode } : { kind: "press", sequence, episode, value };
      send(message);
      lesson.sent.push({ ...message, at: performance.now() });
      say.saying = value;
      say.episode = episode;
    }
    const shown = value === null ? null : String(wordSaidBy(value));
    for (const button of at("values").children) button.classList.toggle("on", button.dataset.value === shown);
  },
  again() {
    say.saying = null;
    say.episode = -1;
  },
};

const ARROWS = { ArrowLeft: "first", ArrowRight: "last", ArrowDown: "middle" };

function valueOf(place) {
  const values = choices();
  if (!values.length) return null;
  if (place === "first") return values[0];
  if (place === "last") return values[values.length - 1];
  return values.length % 2 ? values[(values.length - 1) / 2] : null;
}

// Arrows say the first, the middle and the last of what can be said, digits each of them.
function valueOfKey(key) {
  if (key in ARROWS) return valueOf(ARROWS[key]);
  const value = /^[1-9]$/.test(key) ? choices()[Number(key) - 1] : undefined;
  return value === undefined ? null : value;
}

addEventListener("keydown", (event) => {
  if (event.target instanceof HTMLInputElement) return;
  if (event.key === " " && !(event.target instanceof HTMLButtonElement) && !(event.target instanceof HTMLSelectElement)) {
    event.preventDefault();
    at("pause").click();
  }
  if (event.target instanceof HTMLSelectElement || event.ctrlKey || event.metaKey || event.altKey) return;
  const value = valueOfKey(event.key);
  if (event.key in ARROWS || value !== null) event.preventDefault();
  if (value !== null && !event.repeat) say.press(event.key, value);
});
addEventListener("keyup", (event) => say.release(event.key));
addEventListener("blur", () => say.releaseAll());
document.addEventListener("visibilitychange", () => document.hidden && say.releaseAll());
for (const end of ["pointerup", "pointercancel"]) addEventListener(end, (event) => say.release(`pointer ${event.pointerId}`));

at("stage").addEventListener("pointerdown", (event) => {
  const box = at("stage").getBoundingClientRect();
  const values = choices();
  const value = values[Math.min(values.length - 1, Math.floor((values.length * (event.clientX - box.left)) / box.width))];
  if (value !== undefined) say.press(`pointer ${event.pointerId}`, value);
});

// ---- the controls

at("pause").onclick = () => send({ kind: "pause", on: !(now.controls && now.controls.paused) });
at("oracle").onclick = () => send({ kind: "oracle", on: !(now.controls && now.controls.oracle) });
at("sit").onclick = () => send({ kind: "sit" });
at("speed").onchange = () => {
  send({ kind: "speed", times: JSON.parse(at("speed").value) });
  at("speed").blur();
};

function enable() {
  const instructs = Boolean(now.seat && now.seat.instructs);
  const fields = [at("typed"), ...at("names").children, ...at("phrases").querySelectorAll("select")];
  for (const part of [at("pause"), at("speed"), at("oracle"), ...at("values").children, ...fields]) part.disabled = !instructs;
  if (now.about && now.about.oracle === false) at("oracle").disabled = true;
}

// ---- what the server says

let trail = [];
let coming = []; // frames that arrived since the last drawing
let arrived = 0;
let lastFrameAt = performance.now();

const hear = {
  about(message) {
    now.about = message;
    at("name").textContent = `Teach the agent: ${message.name}`;
    at("run").textContent = message.run;
    makeButtons();
    enable();
    if (message.live_view) Object.assign(at("live-view"), { href: message.live_view, hidden: false });
    const hold = message.hold_steps === null ? "an instruction holds until the episode ends"
      : message.hold_steps > 0 ? `an instruction holds for ${message.hold_steps} steps` : "without it no instruction is given";
    const others = message.others ? ` The ${message.others} other environments are instructed by ${{ oracle: "the oracle", silent: "no one", habits: "a model of your habits" }[message.others_instructed_by]}.` : "";
    at("how").textContent = `Hold an arrow key, a digit, a button, or a part of the picture; ${hold}.${others} You decide what it means; the agent has to find out.`;
  },
  scene(message) {
    now.scene = message;
    now.explanation = now.otherwise = null;
    at("whatever").textContent = "";
    trail = [];
    say.now();
  },
  frame(message) {
    coming = [...coming.slice(-1), message]; // two in the time of one picture are drawn one after the other
    lesson.received += 1;
    arrived += 1;
    lastFrameAt = performance.now();
    for (const one of lesson.sent) {
      if (one.counted === undefined && message.heard >= one.sequence) {
        one.counted = message.step - 1;
        lesson.waits.push(performance.now() - one.at);
      }
    }
    if (message.at && message.episode === (now.scene && now.scene.episode)) trail.push(message.at);
  },
  explanation(message) {
    now.explanation = message;
    if (message.what_if && message.what_if.length) now.otherwise = { ...message, at: performance.now() };
    const same = now.otherwise && now.otherwise.whatever; // asked a moment ago: said only as long as it still fits
    at("whatever").textContent = same && same === message.said ? `whatever you say now: ${same}` : "";
  },
  vocabulary(message) {
    now.vocabulary = message;
    at("meaning").textContent = message.meaning.join("; ");
    at("learnt-at").textContent = `learnt at ${message.frame.toLocaleString("en")} frames, for ${message.horizon_steps} steps`;
    at("vocabulary").replaceChildren(...message.clusters.map((cluster) => {
      const line = document.createElement("li");
      const dot = document.createElement("i");
      dot.style.background = `rgb(${cluster.colour.join(" ")})`;
      const part = (text) => Object.assign(document.createElement("span"), { textContent: text });
      const phrase = Object.assign(document.createElement("div"), { textContent: cluster.phrase });
      const number = !cluster.known ? "-" : now.words ? percent(cluster.expression) : signed(Number(cluster.expression.toFixed(2)));
      line.append(dot, part(number), phrase, part(percent(cluster.share)));
      line.dataset.phrase = cluster.phrase;
      return line;
    }));
  },
  figures(message) {
    now.figures = message;
    const shown = (value, text) => (value === undefined ? "–" : text(value));
    at("success").textContent = shown(message.success_rate, percent);
    at("return").textContent = shown(message.return_mean, (value) => value.toFixed(0));
    const total = now.about ? ` of ${now.about.total_frames.toLocaleString("en")}` : "";
    at("frames").textContent = message.frames.toLocaleString("en") + total;
    drawCurve(message.curve);
  },
  ended(message) {
    at("last").textContent = `${message.success ? "success" : "no success"}, return ${message.return.toFixed(0)}`;
  },
  seat(message) {
    now.seat = message;
    const others = message.pages > 1 ? `, ${message.pages} pages are open` : "";
    show("seat", message.instructs ? `you instruct${others}` : `you watch${others}`, message.instructs ? "pill instructs" : "pill");
    at("sit").hidden = message.instructs || !message.free;
    enable();
    say.again();
    say.now();
  },
  controls(message) {
    now.controls = message;
    at("pause").textContent = message.paused ? "resume" : "pause";
    at("pause").setAttribute("aria-pressed", message.paused);
    at("oracle").textContent = message.oracle ? "take over from the oracle" : "hand over to the oracle";
    at("oracle").setAttribute("aria-pressed", message.oracle);
    const value = JSON.stringify(message.speed);
    if (![...at("speed").options].some((option) => option.value === value)) at("speed").add(new Option(`${message.speed} ×`, value));
    at("speed").value = value;
  },
  farewell(message) {
    over = true;
    show("connection", "over", "pill");
    notice(`${message.text} The run is in the folder ${now.about ? now.about.run : "of the run"}.`, true);
  },
};

function show(id, text, kind) {
  at(id).textContent = text;
  if (kind !== undefined) at(id).className = kind;
}

function notice(text, calm = false) {
  at("notice").hidden = text === null;
  at("notice").textContent = text || "";
  at("notice").className = calm ? "calm" : "";
}

setInterval(() => {
  lesson.rate = arrived;
  arrived = 0;
  at("rate").textContent = lesson.connected ? `${lesson.rate} frames/s` : "";
}, 1000);

addEventListener("DOMContentLoaded", connect); // once drawing.js is there too
