"use strict";
// The lesson in sum: what was said, what it means to the agent, and short films. Needs shapes.js and #summary.

const FILM_PICTURE_MS = 80, FILM_PAUSE_MS = 700;

function element(kind, text, properties = {}) {
  return Object.assign(document.createElement(kind), { textContent: text }, properties);
}

// What became of an explanation, in a sentence.
function cameTo(outcome) {
  return outcome.came_true ? "That came true." : `It went: ${outcome.went}.`;
}

function showSummary(summary) {
  const root = document.getElementById("summary");
  const table = document.createElement("table");
  const row = (cells, kind) => {
    const line = document.createElement("tr");
    for (const cell of cells) line.appendChild(document.createElement(kind)).append(element("bdi", cell));
    return line;
  };
  table.append(row(["you said", "steps", "of these in good episodes"], "th"));
  for (const one of summary.words) table.append(row([one.word, String(one.said_steps), String(one.in_good_episodes)], "td"));
  const consistent = summary.consistency === null ? "Too little was said to tell how consistent you were."
    : `At ${Math.round(100 * summary.consistency)} % of the steps you said what you usually say there.`;
  const marked = summary.marked === 1 ? "1 explanation" : `${summary.marked} explanations`;
  root.replaceChildren(
    element("h2", `What you have taught in ${summary.episodes} episodes`),
    element("p", summary.understood),
    element("p", `${consistent} You called ${marked} wrong.`),
    table,
    element("h2", "What it means to the agent"),
    ...summary.meaning.map((text) => element("p", text)),
    element("h2", summary.films.length ? "What it said, and what came" : ""),
  );
  const films = element("div", "", { className: "films" });
  root.append(films);
  for (const film of summary.films) {
    const figure = document.createElement("figure");
    const surface = document.createElement("canvas");
    figure.append(surface, element("figcaption", `It said: ${film.said}. ${cameTo(film)}`, { className: film.came_true ? "" : "quiet" }));
    films.append(figure);
    play(surface, film);
  }
}

function play(surface, film, picture = 0) {
  if (!surface.isConnected) return;
  const [width, height] = film.size;
  const high = (surface.clientWidth * height) / width;
  surface.style.height = `${high}px`;
  fit(surface, high);
  const pen = surface.getContext("2d");
  const place = placing(surface, film.size);
  pen.clearRect(0, 0, surface.width, surface.height);
  pen.lineWidth = 1.5 * devicePixelRatio;
  for (const one of film.background) shape(pen, one, place);
  for (const one of film.pictures[picture]) shape(pen, one, place);
  const last = picture === film.pictures.length - 1;
  setTimeout(() => play(surface, film, last ? 0 : picture + 1), last ? FILM_PAUSE_MS : FILM_PICTURE_MS);
}
