"use strict";
// Words of one's own: the buttons, their names, typed words; and what became of the last explanation.

function choices() {
  return now.words ? now.words.words : now.about ? now.about.values : [];
}

const keyOf = (index) => (index < 9 ? String(index + 1) : "");

function makeButtons() {
  const values = choices();
  const arrows = { [values[0]]: "←", [values[values.length - 1]]: "→", [valueOf("middle")]: "↓" };
  at("values").classList.toggle("many", values.length > 4);
  at("values").replaceChildren(...values.map((value, index) => {
    const button = document.createElement("button");
    button.dataset.value = value;
    button.dir = "auto";
    const [large, small] = now.words ? [value, keyOf(index)] : [arrows[value] || "·", signed(value)];
    button.append(large, Object.assign(document.createElement("small"), { textContent: small }));
    button.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      say.press(`pointer ${event.pointerId}`, value);
    });
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    return button;
  }));
}

// One field for each word, and an empty one while there is room for another.
function makeNames() {
  const words = choices();
  const fields = now.words.words.length < now.words.most ? [...words, ""] : words;
  at("wording").hidden = false;
  if (at("names").contains(document.activeElement)) document.activeElement.blur();
  at("names").replaceChildren(...fields.map((word, slot) => {
    const field = document.createElement("input");
    Object.assign(field, { value: word, maxLength: 40, dir: "auto", placeholder: "a new word", enterKeyHint: "done" });
    field.setAttribute("aria-label", word ? `another name for ${word}` : "a new word");
    field.addEventListener("change", () => {
      if (field.value.trim() && field.value !== word) send({ kind: "name", slot, word: field.value });
      else field.value = word;
    });
    field.addEventListener("keydown", (event) => event.key === "Enter" && field.blur());
    return field;
  }));
  enable();
}

// ---- typed texts: one that is not known yet becomes a phrase of the most similar word, or a word of its own

const alike = (one, other) => one.normalize("NFKC").toLowerCase() === other.normalize("NFKC").toLowerCase();

function wordSaidBy(value) {
  if (value === null || !now.words || now.words.words.includes(value)) return value;
  const slot = now.words.phrases.findIndex((phrases) => phrases.some((phrase) => alike(phrase, value)));
  return slot < 0 ? value : now.words.words[slot];
}

// Each phrase with the word that it says, to be corrected.
function makePhrases() {
  const words = now.words.words;
  const rows = now.words.phrases.flatMap((phrases, slot) => phrases.map((phrase) => phraseRow(phrase, slot, words)));
  at("phrases").hidden = !rows.length;
  at("phrases").replaceChildren(...rows);
}

function phraseRow(phrase, slot, words) {
  const choice = document.createElement("select");
  choice.setAttribute("aria-label", `${phrase} says`);
  choice.append(...words.map((word, other) => new Option(word, other)), new Option("a word of its own", words.length));
  choice.value = slot;
  choice.addEventListener("change", () => send({ kind: "counts as", text: phrase, slot: Number(choice.value) }));
  const row = document.createElement("li");
  row.append(Object.assign(document.createElement("bdi"), { textContent: phrase }), " says ", choice);
  return row;
}

// A typed text is said for a moment.
const TYPED_HOLDS_MS = 1000;
let typedCount = 0;

at("typing").addEventListener("submit", (event) => {
  event.preventDefault();
  const text = at("typed").value.normalize("NFC").trim().replace(/\s+/g, " ");
  if (!text) return;
  at("typed").value = "";
  const known = [...choices(), ...now.words.phrases.flat()].find((one) => alike(one, text));
  if (known === undefined) send({ kind: "typed", text });
  const source = `typed ${(typedCount += 1)}`;
  say.press(source, known === undefined ? text : known);
  setTimeout(() => say.release(source), TYPED_HOLDS_MS);
});

function showShares(said) {
  const shares = said.shares || [];
  at("gauge").hidden = at("scale").hidden = at("legend-instruction").hidden = Boolean(now.words);
  at("shares").hidden = !shares.length;
  if (!shares.length || at("shares").dataset.shown === JSON.stringify(shares)) return;
  at("shares").dataset.shown = JSON.stringify(shares);
  at("shares").replaceChildren(...shares.map(([word, share]) => {
    const row = document.createElement("li");
    const name = Object.assign(document.createElement("bdi"), { textContent: word });
    const bar = document.createElement("i");
    bar.style.width = percent(Math.max(0, share)).replace(" ", "");
    row.append(name, bar);
    return row;
  }));
}

// ---- what became of it: each outcome stays long enough to be read

const OUTCOME_SHOWN_MS = 2500;
let outcomeAt = -OUTCOME_SHOWN_MS;

Object.assign(hear, {
  words(message) {
    const before = wordSaidBy(say.saying);
    now.words = message;
    for (const one of [...held]) if (!message.words.includes(wordSaidBy(one.value))) say.release(one.source); // renamed
    makeButtons();
    makePhrases();
    makeNames();
    if (wordSaidBy(say.saying) !== before) say.again(); // what is held says another word now
    say.now();
  },
  outcome(message) {
    if (performance.now() - outcomeAt < OUTCOME_SHOWN_MS) return;
    outcomeAt = performance.now();
    now.outcome = message;
    at("came").textContent = `It said: ${message.said}. ${cameTo(message)}`;
    at("outcome").classList.toggle("true", message.came_true);
    at("wrong").textContent = "that was wrong";
    at("wrong").disabled = !(now.seat && now.seat.instructs);
  },
  understood(message) {
    now.understood = message;
    at("understood").textContent = message.text;
  },
  summary(message) {
    now.summary = message;
    at("summary").hidden = false;
    showSummary(message);
    at("summary").scrollIntoView();
  },
  refused(message) {
    now.refused = message;
    const trivial = ["past", "repeated", "watching"].includes(message.why);
    at("refused").textContent = trivial ? "" : message.why;
    if (trivial || !now.words) return; // nothing is written over while somebody types
    makePhrases();
    makeNames();
  },
});

at("wrong").onclick = () => {
  if (!now.outcome) return;
  send({ kind: "wrong", episode: now.outcome.episode, step: now.outcome.step });
  at("wrong").textContent = "noted";
  at("wrong").disabled = true;
};
