"use strict";
// A recording on a canvas: its frames play once; a place in it can be chosen with pointer, touch or keys.

const STEPS = { ArrowLeft: -0.01, ArrowRight: 0.01, PageDown: -0.1, PageUp: 0.1, Home: -1, End: 1 };
const TRUE_COLOUR = "rgb(86 180 233)";
const CHOSEN_COLOUR = "rgb(240 228 66)";
const MOST_OF_SCREEN = 45; // percent of its height, but for small screens

class Recording {
  // `recording` as the server gave it; `label` names it for those who do not see it.
  constructor(recording, label) {
    Object.assign(this, { ...recording, shown: recording.frames[0], place: null, truth: null, chosen: null });
    this.canvas = make("canvas", { role: "img", ariaLabel: label });
    const [width, height] = this.size;
    this.canvas.style.aspectRatio = `${width} / ${height}`;
    this.words = make("p", { className: "words" });
    this.needle = make("i", { hidden: true });
    this.element = make("div", { className: "recording" }, ...(this.said ? [this.words, make("div", { className: "gauge" }, this.needle)] : []), this.canvas);
    this.element.style.maxWidth = `max(20rem, ${(MOST_OF_SCREEN * width) / height}vh)`;
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  async play(frames = this.frames, said = this.said) {
    for (let frame = 0; frame < frames.length; frame += 1) {
      this.shown = frames[frame];
      this.draw();
      if (said) this.tell(said.phrases[frame], said.expressions[frame]);
      do await new Promise((passed) => setTimeout(passed, this.frame_ms));
      while (document.hidden); // nothing plays while nobody can see it
    }
  }

  tell(phrase, expression) {
    this.words.textContent = phrase;
    this.needle.hidden = false;
    this.needle.style.left = `${50 + 50 * Math.max(-1, Math.min(1, expression))}%`;
  }

  askPlace(label, chosen) {
    this.chosen = chosen;
    const set = (event) => {
      const box = this.canvas.getBoundingClientRect();
      this.put((event.clientX - box.left) / box.width);
    };
    Object.assign(this.canvas, { id: "place", tabIndex: 0, role: "slider", ariaLabel: label, ariaValueMin: 0, ariaValueMax: 100 });
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      set(event);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) set(event);
    });
    this.canvas.addEventListener("keydown", (event) => {
      if (!(event.key in STEPS)) return;
      event.preventDefault();
      this.put((this.place === null ? 0.5 : this.place) + STEPS[event.key]);
    });
  }

  put(place) {
    if (!this.chosen) return;
    this.place = Math.min(1, Math.max(0, place));
    this.canvas.ariaValueNow = Math.round(100 * this.place);
    this.draw();
    this.chosen(this.place);
  }

  draw() {
    const [width, height] = this.size;
    const wide = Math.round(this.canvas.clientWidth * devicePixelRatio);
    const high = Math.round((wide * height) / width);
    if (!wide) return;
    if (this.canvas.width !== wide || this.canvas.height !== high) Object.assign(this.canvas, { width: wide, height: high });
    this.pen = this.canvas.getContext("2d");
    this.pen.clearRect(0, 0, wide, high);
    this.pen.lineJoin = "round";
    this.pen.lineWidth = 2 * devicePixelRatio;
    const at = ([x, y]) => [(x * wide) / width, high - (y * wide) / width];
    for (const one of [...this.background, ...this.shown]) this.shape(one, at);
    this.mark(this.truth, TRUE_COLOUR, [], wide, high);
    this.mark(this.place, CHOSEN_COLOUR, [8, 6], wide, high);
  }

  shape({ points, colour, closed }, at) {
    this.pen.beginPath();
    points.forEach((point, index) => this.pen[index ? "lineTo" : "moveTo"](...at(point)));
    if (closed) {
      this.pen.closePath();
      this.pen.fillStyle = `rgb(${colour.join(" ")} / 45%)`;
      this.pen.fill();
    }
    this.pen.strokeStyle = `rgb(${colour.join(" ")})`;
    this.pen.stroke();
  }

  mark(place, colour, dashes, wide, high) {
    if (place === null) return;
    const x = place * wide;
    const half = 8 * devicePixelRatio;
    this.pen.strokeStyle = this.pen.fillStyle = colour;
    this.pen.lineWidth = 3 * devicePixelRatio;
    this.pen.setLineDash(dashes.map((length) => length * devicePixelRatio));
    this.pen.beginPath();
    this.pen.moveTo(x, 0);
    this.pen.lineTo(x, high);
    this.pen.stroke();
    this.pen.setLineDash([]);
    this.pen.beginPath();
    this.pen.moveTo(x - half, 0);
    this.pen.lineTo(x + half, 0);
    this.pen.lineTo(x, 1.5 * half);
    this.pen.fill();
  }
}
