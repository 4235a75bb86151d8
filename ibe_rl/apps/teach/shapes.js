"use strict";
// Lines and shapes of a scene; used by the page of the lesson and by its summary.

function fit(surface, height) {
  const wide = Math.round(surface.clientWidth * devicePixelRatio);
  const high = Math.round(height * devicePixelRatio);
  if (surface.width !== wide || surface.height !== high) Object.assign(surface, { width: wide, height: high });
}

// From scene units, y up, to the pixels of a surface.
function placing(surface, [width, height]) {
  const scale = Math.min(surface.width / width, surface.height / height);
  const left = (surface.width - scale * width) / 2;
  return ([x, y]) => [left + x * scale, surface.height - y * scale];
}

function line(pen, points, place) {
  pen.beginPath();
  points.forEach((point, index) => pen[index ? "lineTo" : "moveTo"](...place(point)));
}

function shape(pen, one, place) {
  line(pen, one.points, place);
  if (one.closed) {
    pen.closePath();
    pen.fillStyle = `rgb(${one.colour.join(" ")} / 45%)`;
    pen.fill();
  }
  pen.strokeStyle = `rgb(${one.colour.join(" ")})`;
  pen.stroke();
}
