"use strict";
// The pictures of the page: the game, the gauge and the curve, drawn from `now` at each frame of the screen.

const canvas = at("canvas");
const pen = canvas.getContext("2d");

const OTHERWISE_SHOWN_MS = 1500;

// What it would do if it were told something else: faint, with what it is told at the end of each path.
function drawOtherwise(place) {
  const answers = now.otherwise;
  if (!answers || answers.episode !== now.frame.episode || performance.now() - answers.at > OTHERWISE_SHOWN_MS) return;
  pen.font = `${12 * devicePixelRatio}px system-ui, sans-serif`;
  answers.what_if.forEach((one, index) => {
    if (!one.path) return;
    const hue = 210 + (360 * index) / answers.what_if.length;
    line(pen, one.path, place);
    pen.strokeStyle = `hsl(${hue} 80% 65% / 45%)`;
    pen.stroke();
    pen.fillStyle = `hsl(${hue} 80% 75% / 70%)`;
    const [x, y] = place(one.path[one.path.length - 1]);
    const name = now.words ? one.told : signed(choices()[index]);
    const told = name.length > 14 ? `${name.slice(0, 13)}…` : name;
    const wide = pen.measureText(told).width;
    const below = y + 14 * devicePixelRatio;
    pen.fillText(told, Math.max(0, Math.min(canvas.width - wide, x - wide / 2)), Math.min(canvas.height - 4, below));
  });
}

function draw() {
  requestAnimationFrame(draw);
  if (coming.length) lesson.drawn += 1;
  now.frame = coming.shift() || now.frame;
  words();
  if (!now.scene || !now.frame) return;
  const [width, height] = now.scene.size;
  const limit = Math.max(260, innerHeight - (now.words ? 440 : 370));
  const high = Math.min((canvas.clientWidth * height) / width, limit);
  canvas.style.height = `${high}px`;
  fit(canvas, high);
  const place = placing(canvas, now.scene.size);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.lineWidth = 2 * devicePixelRatio;
  pen.lineJoin = "round";
  for (const one of now.scene.background) shape(pen, one, place);
  if (trail.length > 1) {
    line(pen, trail, place);
    pen.strokeStyle = "rgb(232 232 238 / 35%)";
    pen.stroke();
  }
  drawOtherwise(place);
  if (now.explanation && now.explanation.path && now.explanation.episode === now.frame.episode) {
    line(pen, now.explanation.path, place);
    pen.setLineDash([6 * devicePixelRatio, 5 * devicePixelRatio]);
    pen.strokeStyle = "rgb(45 212 191)";
    pen.stroke();
    pen.setLineDash([]);
  }
  if (now.frame.episode === now.scene.episode) for (const one of now.frame.shapes) shape(pen, one, place);
}

function words() {
  const frame = now.frame;
  const said = now.explanation;
  const waits = lesson.connected && !over && performance.now() - lastFrameAt > 700 && !(now.controls && now.controls.paused);
  at("waiting").hidden = !waits;
  if (frame) {
    const by = { person: "you say", held: "you said", oracle: "the oracle says" }[frame.by];
    at("instruction").textContent = frame.instruction === null ? "no instruction" : `${by} ${frame.word || signed(frame.instruction)}`;
    at("episode").textContent = `episode ${frame.episode + 1}, step ${frame.step}, return ${frame.return.toFixed(0)}`;
    mark("gauge-instruction", now.words ? null : frame.instruction);
  }
  mark("gauge-said", said && said.expression !== undefined ? said.expression : null);
  if (!said) return;
  showShares(said);
  show("said", said.said, said.known ? "" : "unknown");
  const why = now.vocabulary ? now.vocabulary.meaning.join("; ") : "";
  at("in-time").textContent = !said.meant ? why : said.known && said.in_time !== said.said ? said.in_time : "";
  const sure = said.confidence === null ? "" : `, ${percent(said.confidence)} sure`;
  at("sure").textContent = said.meant ? `${sure}, for ${said.horizon_steps} steps` : "";
  for (const entry of at("vocabulary").children) entry.classList.toggle("now", said.known && entry.dataset.phrase === said.said);
}

function mark(id, value) {
  at(id).style.display = value === null ? "none" : "block";
  if (value !== null) at(id).style.left = `${50 + 50 * value}%`;
}

function drawCurve(curve) {
  const surface = at("curve");
  fit(surface, 56);
  const ink = surface.getContext("2d");
  ink.clearRect(0, 0, surface.width, surface.height);
  const end = Math.max(now.about ? now.about.total_frames : 1, 1);
  ink.strokeStyle = "rgb(132 224 96)";
  ink.lineWidth = 2 * devicePixelRatio;
  ink.beginPath();
  curve.forEach(([frames, success], index) => {
    const point = [(frames / end) * surface.width, surface.height - 2 - success * (surface.height - 4)];
    ink[index ? "lineTo" : "moveTo"](...point);
  });
  ink.stroke();
}

requestAnimationFrame(draw);
