// The plots: each pane is a canvas with its curves drawn once, and a cursor drawn over them.

const INK = "#24292f", PALE = "#57606a", LINE = "#d8dee4", FONT = "system-ui, sans-serif";
const LEFT = 62, RIGHT = 10, ROW = 17, HEAD = 24, FOOT = 25, DECADES = 9;

// Steps of 1, 2 or 5 times a power of ten.
function ticks(low, high, most) {
  const raw = (high - low) / most, decade = 10 ** Math.floor(Math.log10(raw));
  const step = decade * [1, 2, 5, 10].find(k => k * decade >= raw * 0.8), out = [];
  for (let k = Math.ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; k++) out.push(k * step);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const write = x => Math.abs(x) >= 1e5 || digits > 4 ? x.toExponential(Math.abs(x) < step / 2 ? 0 : 1) : x.toFixed(digits);
  return out.map(x => [x, write(Math.abs(x) < step / 1e6 ? 0 : x).replace("-", "−")]);
}

function number(x) {
  if (!Number.isFinite(x)) return "–";
  const size = Math.abs(x);
  const text = size !== 0 && (size < 1e-3 || size >= 1e5) ? x.toExponential(2) : x.toFixed(size >= 100 ? 1 : size >= 10 ? 2 : 3);
  return text.replace("-", "−");
}

function valueAt({t, y}, time) {
  const rising = t[t.length - 1] >= t[0];
  let low = 0, high = t.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if ((t[middle] <= time) === rising) low = middle; else high = middle;
  }
  const share = t[high] === t[low] ? 0 : Math.min(1, Math.max(0, (time - t[low]) / (t[high] - t[low])));
  return share === 0 ? y[low] : share === 1 ? y[high] : y[low] + share * (y[high] - y[low]);
}

// Least and largest ordinate, in powers of ten where it is logarithmic.
function range({curves, logarithmic}) {
  let low = Infinity, high = -Infinity;
  for (const {y} of curves) {
    for (const x of y) {
      if (!Number.isFinite(x) || (logarithmic && x <= 0)) continue;
      const value = logarithmic ? Math.log10(x) : x;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  if (low > high) return logarithmic ? [-16, -15] : [-1, 1];
  if (logarithmic) {
    const top = Math.ceil(high + 1e-9);
    return [Math.max(Math.min(Math.floor(low), top - 1), top - DECADES), top];  // zero is far below
  }
  const pad = Math.max(0.06 * (high - low), 1e-6 * Math.max(Math.abs(low), Math.abs(high)), 1e-30);
  return [low - pad, high + pad];
}

class Pane {
  constructor(canvas, data, scene, seek) {
    Object.assign(this, {canvas, data, static: document.createElement("canvas")});
    this.span = [Math.min(scene.start, scene.end), Math.max(scene.start, scene.end)];
    if (this.span[0] === this.span[1]) this.span[1] += 1;
    this.range = range(data);
    const names = [...new Set(data.curves.map(curve => curve.name))];
    this.colour = curve => curve.ghost < 0 ? data.colours[names.indexOf(curve.name) % data.colours.length]
      : scene.ghosts[curve.ghost].colour;
    // More curves than colours: the later ones are dashed and dotted.
    this.dashes = curve => curve.ghost >= 0 ? [5, 3]
      : names.indexOf(curve.name) < data.colours.length ? [] : [9, 3, 2, 3];
    this.own = data.curves.filter(curve => curve.ghost < 0);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${data.title} over time: ${names.join(", ")}`);
    const drag = event => {
      const [low, high] = this.span;
      seek(low + (event.offsetX - LEFT) / (canvas.clientWidth - LEFT - RIGHT) * (high - low));
    };
    canvas.addEventListener("pointerdown", event => {
      canvas.setPointerCapture(event.pointerId);
      drag(event);
    });
    canvas.addEventListener("pointermove", event => { if (event.buttons) drag(event); });
  }

  x(t) { return LEFT + (t - this.span[0]) / (this.span[1] - this.span[0]) * (this.width - LEFT - RIGHT); }

  y(value) {
    const [low, high] = this.range, at = this.data.logarithmic ? Math.log10(value) : value;
    return this.height - FOOT - (at - low) / (high - low) * (this.height - FOOT - this.top);
  }

  // Room for the legend first, as many rows as its names need at this width.
  arrange(width) {
    const context = this.static.getContext("2d");
    context.font = `12px ${FONT}`;
    const room = context.measureText(" −0.00e−00").width;
    let x = LEFT, row = 0;
    this.entries = this.own.map(curve => {
      const wide = 22 + context.measureText(curve.name).width + room;
      if (x > LEFT && x + wide > width - RIGHT) [x, row] = [LEFT, row + 1];
      const entry = {curve, x, y: HEAD + ROW * row + 5, at: x + wide - room};
      x += wide + 6;
      return entry;
    });
    this.top = HEAD + ROW * (row + 1) + 2;
    return this.top + FOOT + 84;
  }

  resize(width, height) {
    const ratio = window.devicePixelRatio || 1;
    Object.assign(this, {width, height, ratio});
    for (const canvas of [this.canvas, this.static]) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const c = this.static.getContext("2d");
    c.scale(ratio, ratio);
    c.fillStyle = "#fff";
    c.fillRect(0, 0, width, height);
    this.axes(c);
    c.save();
    c.beginPath();
    c.rect(LEFT, this.top - 1, width - LEFT - RIGHT, height - FOOT - this.top + 2);
    c.clip();
    for (const curve of [...this.data.curves].sort((a, b) => b.ghost - a.ghost)) this.curve(c, curve);
    c.restore();
  }

  axes(c) {
    const {width, height, top} = this, logarithmic = this.data.logarithmic;
    c.textBaseline = "middle";
    c.fillStyle = INK;
    c.font = `600 12.5px ${FONT}`;
    c.fillText(this.data.title, LEFT, 13, width - LEFT - RIGHT);
    c.font = `12px ${FONT}`;
    for (const {curve, x, y, at} of this.entries) {
      c.fillStyle = this.colour(curve);
      c.fillRect(x, y - 1.5, 14, 3);
      c.fillStyle = PALE;
      c.fillText(curve.name, x + 19, y);
    }
    c.font = `11px ${FONT}`;
    c.strokeStyle = LINE;
    c.fillStyle = PALE;
    const rows = Math.max(2, Math.floor((height - FOOT - top) / 27));
    let marks = ticks(...this.range, rows);
    if (logarithmic) {
      const [low, high] = this.range, step = Math.ceil((high - low) / rows);
      marks = [];
      for (let k = high; k >= low; k -= step) marks.unshift([10 ** k, `1e${k}`.replace("-", "−")]);
    }
    c.textAlign = "right";
    for (const [value, text] of marks) {
      const y = Math.round(this.y(value)) + 0.5;
      c.beginPath();
      c.moveTo(LEFT, y);
      c.lineTo(width - RIGHT, y);
      c.stroke();
      c.fillText(text, LEFT - 6, y);
    }
    c.textAlign = "center";
    for (const [t, text] of ticks(...this.span, Math.max(2, Math.floor(width / 75)))) {
      const x = Math.round(this.x(t)) + 0.5, half = c.measureText(text).width / 2;
      c.beginPath();
      c.moveTo(x, top);
      c.lineTo(x, height - FOOT);
      c.stroke();
      c.fillText(text, Math.min(x, width - half - 1), height - FOOT + 12);
    }
    c.textAlign = "right";
    c.fillText("t (s)", LEFT - 16, height - FOOT + 12);
    c.textAlign = "left";
  }

  curve(c, curve) {
    const {t, y, ghost} = curve;
    c.beginPath();
    let drawing = false;
    for (let i = 0; i < t.length; i++) {
      const shown = Number.isFinite(y[i]) && !(this.data.logarithmic && y[i] <= 0);
      if (shown && drawing) c.lineTo(this.x(t[i]), this.y(y[i]));
      else if (shown) c.moveTo(this.x(t[i]), this.y(y[i]));
      drawing = shown;
    }
    c.setLineDash(this.dashes(curve));
    c.lineJoin = "round";
    c.lineWidth = ghost < 0 ? 1.7 : 1.3;
    c.strokeStyle = this.colour(curve);
    c.stroke();
    c.setLineDash([]);
  }

  draw(time) {
    const c = this.canvas.getContext("2d"), x = this.x(time);
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.drawImage(this.static, 0, 0);
    c.scale(this.ratio, this.ratio);
    c.fillStyle = "#cf222e";
    c.fillRect(x - 0.75, this.top, 1.5, this.height - FOOT - this.top);
    c.font = `12px ${FONT}`;
    c.textBaseline = "middle";
    for (const {curve, at, y} of this.entries) {
      const value = valueAt(curve, time);
      c.fillStyle = INK;
      c.fillText(number(value), at + 4, y);
      if (!Number.isFinite(value) || (this.data.logarithmic && value <= 0)) continue;
      c.fillStyle = this.colour(curve);
      c.beginPath();
      c.arc(x, this.y(value), 3.2, 0, 7);
      c.fill();
    }
  }
}

// All panes under each other; they share what height there is.
function plot(scene, seek) {
  const box = document.getElementById("plots");
  document.querySelector("main").classList.toggle("bare", scene.panes.length === 0);
  const panes = scene.panes.map(data => new Pane(box.appendChild(document.createElement("canvas")), data, scene, seek));
  let shown = NaN;
  return {
    panes,
    resize() {
      const width = box.clientWidth - parseFloat(getComputedStyle(box).paddingRight);
      for (const pane of panes) pane.canvas.style.flexBasis = `${pane.arrange(width)}px`;
      for (const pane of panes) pane.resize(pane.canvas.clientWidth, pane.canvas.clientHeight);
      shown = NaN;
    },
    draw(time) {
      if (time === shown) return;
      for (const pane of panes) pane.draw(time);
      shown = time;
    },
  };
}
