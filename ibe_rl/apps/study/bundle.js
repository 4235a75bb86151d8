"use strict";
// Takes the place of the server in a bundle of static files: gives the pages of one place in order, and sends each
// answer to the endpoint that collects them. The next page shows once the endpoint has confirmed.
//
// What is sent: {"id": of the message, "place": of the link, "answer": {page, attempt, value, took_ms, hidden_ms}},
// or {"id", "place", "withdraw": true}. A message that may not have arrived is sent again with the same id.

window.studyBundle = (() => {
  const token = new URLSearchParams(location.search).get("p") || "";
  const key = `study/${token}`;
  const REPEATED = ["instructions", "comprehension"];
  let way = null; // what p/PLACE.json holds
  let here = { place: 0, attempt: 1, ended: null, pending: null };

  const read = async (reply) => (reply.ok ? { status: 200, ...(await reply.json()) } : reply.status === 404 ? { status: 404 } : null);

  function keep(now) {
    here = now;
    try {
      localStorage.setItem(key, JSON.stringify(here));
    } catch {
      // a browser that stores nothing: a reload begins again, and the first answer to a page stays
    }
  }

  function stored() {
    try {
      return JSON.parse(localStorage.getItem(key)) || here;
    } catch {
      return here;
    }
  }

  function newId() {
    return [...crypto.getRandomValues(new Uint8Array(16))].map((one) => one.toString(16).padStart(2, "0")).join("");
  }

  function shown() {
    if (here.ended) return { status: 200, ended: here.ended, ...way.ends[here.ended] };
    const page = way.pages[here.place];
    const attempt = REPEATED.includes(page.kind) ? here.attempt : 1;
    return { status: 200, ...page, attempt, done: here.place, of: way.pages.length };
  }

  function after(page, value) {
    const on = { place: here.place + 1, attempt: here.attempt, ended: null, pending: null };
    if (page.kind === "consent" && !value.agrees) return { ...on, ended: "no_consent" };
    if (page.kind === "debriefing") return { ...on, ended: "finished" };
    if (page.kind !== "comprehension" || page.right.every((right, index) => right === null || right === value.choices[index])) return on;
    if (here.attempt >= way.attempts) return { ...on, ended: "screened_out" };
    return { ...on, place: way.pages.findIndex((one) => one.kind === "instructions"), attempt: here.attempt + 1 };
  }

  async function confirm(message, then) {
    // Kept until it is confirmed: what was sent before a reload is what counts, not a second answer.
    const mine = { message, then };
    keep({ ...here, pending: mine });
    await reach(about.collect, message, (reply) => reply.ok);
    if (here.pending !== mine) return new Promise(() => {}); // they have withdrawn meanwhile
    keep(then);
  }

  async function begin() {
    if (!/^[\w-]+$/.test(token)) return { status: 404 };
    const found = await reach(`p/${token}.json`, undefined, read);
    if (found.status !== 200) return found;
    way = found;
    here = stored();
    if (here.pending) await confirm(here.pending.message, here.pending.then);
    return shown();
  }

  async function ask(path, body) {
    if (path === "/about") return reach("about.json", undefined, (reply) => (reply.ok ? reply.json() : null));
    if (path.endsWith("/now")) return way ? shown() : begin();
    const message = { id: newId(), place: token };
    if (path.endsWith("/withdraw")) return confirm({ ...message, withdraw: true }, { ...here, ended: "withdrawn", pending: null });
    const page = way.pages[here.place];
    await confirm({ ...message, answer: body }, after(page, body.value));
    return { status: 200, feedback: page.feedback, now: shown() };
  }

  return { address: "bundle", ask };
})();
