"use strict";
// The telling episodes: a film where there is one, and lanes of what was told, said and came. Needs shapes.js.

const PICTURE_MS = 80, LAST_MS = 900, NO_COLOUR = "rgb(70 70 78)";

function part(kind, properties = {}, ...inside) {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...inside);
  return made;
}

function showFilms(films, colours) {
  for (const figure of document.querySelectorAll("[data-film]")) new Film(figure, films[Number(figure.dataset.film)], colours);
}

class Film {
  constructor(figure, film, colours) {
    Object.assign(this, { film, picture: 0, playing: !matchMedia("(prefers-reduced-motion: reduce)").matches });
    this.surface = film.pictures ? part("canvas", { role: "img", ariaLabel: "the episode as a film" }) : null;
    this.button = part("button", { type: "button", onclick: () => this.set(!this.playing) });
    this.step = part("span");
    this.cursor = part("b");
    this.lanes = part("div", { className: "lanes", tabIndex: 0, role: "slider", ariaLabel: "step of the episode", ariaValueMin: 0, ariaValueMax: film.steps - 1 });
    this.words = film.lanes.map(() => part("dd", { dir: "auto" }));
    this.lanes.append(...film.lanes.map((lane) => this.lane(lane, colours)), this.cursor);
    const names = film.lanes.map((lane, row) => [part("dt", { textContent: lane.name }), this.words[row]]).flat();
    const now = part("div", { className: "now" }, this.button, this.step);
    figure.prepend(...(this.surface ? [this.surface] : []), now, this.lanes, part("dl", { className: "words" }, ...names));
    this.lanes.onpointerdown = (event) => this.seek(event.clientX);
    this.lanes.onpointermove = (event) => event.buttons && this.seek(event.clientX);
    this.lanes.onkeydown = (event) => this.key(event);
    addEventListener("resize", () => this.show());
    this.set(this.playing);
    this.run();
  }

  // What is told has no colour of a phrase that was said, unless the same words were.
  lane(lane, colours) {
    const spans = lane.spans.map(([, steps, text]) => {
      const one = part("i", { title: text });
      Object.assign(one.style, { flex: `${steps} 0 0`, background: colours[text] ?? NO_COLOUR });
      return one;
    });
    return part("div", { className: "lane" }, part("span", { textContent: lane.name }), ...spans);
  }

  set(playing) {
    this.playing = playing;
    this.button.textContent = playing ? "pause" : "play";
    this.show();
  }

  run() {
    const last = this.picture === this.film.at.length - 1;
    setTimeout(() => {
      if (this.playing && !document.hidden) {
        this.picture = last ? 0 : this.picture + 1;
        this.show();
      }
      this.run();
    }, last ? LAST_MS : PICTURE_MS);
  }

  seek(x) {
    const lane = this.lanes.querySelector("i").parentElement.getBoundingClientRect();
    this.go(Math.round(((x - lane.left) / lane.width) * this.film.at.length));
  }

  key(event) {
    const by = { ArrowLeft: -1, ArrowRight: 1, Home: -Infinity, End: Infinity }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    this.go(this.picture + by);
  }

  go(picture) {
    this.picture = Math.max(0, Math.min(this.film.at.length - 1, picture));
    this.set(false);
  }

  show() {
    const step = this.film.at[this.picture];
    const at = (lane) => lane.spans.find(([first, steps]) => first <= step && step < first + steps)[2];
    this.step.textContent = `step ${step} of ${this.film.steps}`;
    this.film.lanes.forEach((lane, row) => (this.words[row].textContent = at(lane)));
    this.cursor.style.left = `calc(3em + (100% - 3em) * ${(step / this.film.steps).toFixed(4)})`;
    Object.assign(this.lanes, { ariaValueNow: step, ariaValueText: `step ${step}: ${this.words.map((one) => one.textContent).join(", ")}` });
    if (this.surface) this.draw();
  }

  draw() {
    const [width, height] = this.film.size;
    const high = (this.surface.clientWidth * height) / width;
    this.surface.style.height = `${high}px`;
    fit(this.surface, high);
    const pen = this.surface.getContext("2d");
    const place = placing(this.surface, this.film.size);
    pen.clearRect(0, 0, this.surface.width, this.surface.height);
    pen.lineWidth = 1.5 * devicePixelRatio;
    for (const one of [...this.film.background, ...this.film.pictures[this.picture]]) shape(pen, one, place);
  }
}
