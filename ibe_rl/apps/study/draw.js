"use strict";
// An episode on a canvas: frames play once, then a place can be chosen with pointer, touch or keys.

const KEY_STEP = 0.01;

class Episode {
  // `episode` as the server gave it; `playing` is called at each frame, `chosen` at each change of the place.
  constructor(canvas, episode, { playing = () => {}, chosen = null } = {}) {
    Object.assign(this, { canvas, episode, playing, chosen, place: null, truth: null, frame: 0, later: [] });
    this.pen = canvas.getContext("2d");
    this.watch = new ResizeObserver(() => this.draw());
    this.watch.observe(canvas);
    if (chosen) this.listen();
  }

  listen() {
    const move = (event) => {
      const box = this.canvas.getBoundingClientRect();
      this.put((event.clientX - box.left) / box.width);
    };
    this.canvas.tabIndex = 0;
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      move(event);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) move(event);
    });
    this.canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -KEY_STEP, ArrowRight: KEY_STEP, PageDown: -10 * KEY_STEP, PageUp: 10 * KEY_STEP }[event.key];
      if (step === undefined) return;
      event.preventDefault();
      this.put((this.place === null ? 0.5 : this.place) + step);
    });
  }

  put(place) {
    if (!this.done) return; // only once all frames were seen
    this.place = Math.min(1, Math.max(0, place));
    this.draw();
    this.chosen(this.place);
  }

  play(frames = this.episode.frames) {
    this.frames = frames;
    this.frame = 0;
    this.done = false;
    clearInterval(this.timer);
    return new Promise((ended) => {
      const show = () => {
        this.draw();
        this.playing(this.frame);
        if (this.frame < frames.length - 1) {
          this.frame += 1;
        } else {
          clearInterval(this.timer);
          this.done = true;
          ended();
        }
      };
      show();
      this.timer = setInterval(show, this.episode.frame_ms);
    });
  }

  draw() {
    const [width, height] = this.episode.size;
    const wide = Math.round(this.canvas.clientWidth * devicePixelRatio);
    const high = Math.round((wide * height) / width);
    if (this.canvas.width !== wide || this.canvas.height !== high) Object.assign(this.canvas, { width: wide, height: high });
    const scale = wide / width;
    const at = ([x, y]) => [x * scale, high - y * scale];
    this.pen.clearRect(0, 0, wide, high);
    this.pen.lineJoin = "round";
    this.pen.lineWidth = 2 * devicePixelRatio;
    for (const one of [...this.episode.background, ...(this.frames || this.episode.frames)[this.frame]]) this.shape(one, at);
    this.mark(this.truth, "rgb(84 220 150)", [], wide, high);
    this.mark(this.place, "rgb(255 214 102)", [8, 6], wide, high);
  }

  shape(one, at) {
    this.pen.beginPath();
    one.points.forEach((point, index) => this.pen[index ? "lineTo" : "moveTo"](...at(point)));
    if (one.closed) {
      this.pen.closePath();
      this.pen.fillStyle = `rgb(${one.colour.join(" ")} / 45%)`;
      this.pen.fill();
    }
    this.pen.strokeStyle = `rgb(${one.colour.join(" ")})`;
    this.pen.stroke();
  }

  mark(place, colour, dashes, wide, high) {
    if (place === null) return;
    this.pen.beginPath();
    this.pen.setLineDash(dashes.map((length) => length * devicePixelRatio));
    this.pen.strokeStyle = colour;
    this.pen.moveTo(place * wide, 0);
    this.pen.lineTo(place * wide, high);
    this.pen.stroke();
    this.pen.setLineDash([]);
  }

  close() {
    clearInterval(this.timer);
    this.watch.disconnect();
  }
}
