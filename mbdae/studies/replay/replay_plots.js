
// The plots, drawn by uPlot: drag zooms, a click moves the motion there, names hide their curves, all panes zoom together.

const INK = "#24292f", PALE = "#57606a", LINE = "#dfe4e9", FONT = "11px system-ui, sans-serif", DECADES = 16;

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

// Powers of ten from the cut, at rounding, or from the smallest value.
function decades({curves, cut}) {
  let low = Infinity, high = -Infinity;
  for (const {y} of curves) for (const x of y) if (x > 0 && Number.isFinite(x)) [low, high] = [Math.min(low, x), Math.max(high, x)];
  const least = cut > 0 ? Math.log10(cut) : -16;
  const top = Math.max(Math.ceil(Math.log10(high > 0 ? high : 1e-15) + 1e-9), least + 2);
  return [10 ** Math.max(Math.floor(Math.log10(low < Infinity ? low : 1e-16)), Math.floor(least), top - DECADES), 10 ** top];
}

class Pane {
  constructor(box, data, scene, panes, seek) {
    const names = [...new Set(data.curves.map(curve => curve.name))], {colours} = data;
    this.data = data;
    this.time = scene.start;
    this.span = [Math.min(scene.start, scene.end), Math.max(scene.start, scene.end)];
    if (this.span[0] === this.span[1]) this.span[1] += 1;
    const colour = ({ghost, name}) => ghost < 0 ? colours[names.indexOf(name) % colours.length] : scene.ghosts[ghost].colour;
    // More curves than colours: the later ones are dashed and dotted.
    const dash = ({ghost, name}) => ghost >= 0 ? [5, 3] : names.indexOf(name) < colours.length ? [] : [9, 3, 2, 3];
    const range = data.logarithmic ? decades(data) : null;
    const rising = x => (x[0] > x[x.length - 1] ? Array.from(x).reverse() : Array.from(x));
    const tables = data.curves.map(({t, y}) => {
      const cut = Array.from(y, x => (Number.isFinite(x) ? (range ? Math.max(x, range[0]) : x) : null));
      return [rising(t), t[0] > t[t.length - 1] ? cut.reverse() : cut];
    });
    const series = data.curves.map((curve, i) => ({
      label: curve.ghost < 0 ? curve.name : `${curve.name}, ${scene.ghosts[curve.ghost].name}`, stroke: colour(curve),
      class: curve.ghost < 0 ? "own" : "ghost", width: curve.ghost < 0 ? 1.7 : 1.3, dash: dash(curve), points: {show: false}, pxAlign: 0,  // no steps of one pixel
      value: () => number(valueAt(curve, this.time)),
      gaps: (u, k, from, to, found) => found.map(([left, right]) => [left - 2, right + 2]),  // the line across ends there
    }));
    const grid = {stroke: LINE, width: 1}, axis = {stroke: PALE, font: FONT, grid, ticks: {...grid, size: 4}};
    const powers = (u, values) => values.map(x => `1e${Math.round(Math.log10(x))}`.replace("-", "−"));
    const every = () => {  // some powers of ten, from the highest down
      const [low, high] = range.map(x => Math.round(Math.log10(x))), step = Math.ceil((high - low) / 4), out = [];
      for (let k = high; k >= low; k -= step) out.unshift(10 ** k);
      return out;
    };
    const {name: variable, tick, unit} = scene.axis;
    const marked = (u, at) => at.map((t, i) => {
      const text = `${+t.toPrecision(6)}`.replace("-", "−");
      return i === at.length - 1 ? `${tick}${text}${unit}` : text;
    });
    this.plot = new uPlot({
      width: 300, height: 120, title: data.title, series: [{value: () => ""}, ...series],
      legend: {live: true, markers: {width: 0, fill: (u, i) => series[i - 1].stroke}},
      cursor: {sync: {key: "mbdae", setSeries: false}, drag: {x: true, y: false}, points: {size: 6}},
      scales: {x: {time: false}, y: range ? {distr: 3, range: () => range} : {}},
      axes: [
        {...axis, size: 24, gap: 2, space: 60, values: marked},
        {...axis, size: 58, gap: 3, space: 22, ...(range ? {values: powers, splits: every, filter: (u, splits) => splits} : {})},
      ],
      hooks: {
        setScale: [(u, key) => { if (key === "x") zoom(panes, u); }],
      },
    }, uPlot.join(withTimeSpan(tables, this.span)), box);
    const {over, ctx: {canvas}} = this.plot;
    this.line = over.appendChild(document.createElement("div"));
    this.line.className = "now";
    let from = NaN;
    over.addEventListener("mousedown", event => { from = event.clientX; });
    over.addEventListener("click", event => {
      if (Math.abs(event.clientX - from) < 4) seek(this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x"));
    });
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${data.title} over ${variable}: ${names.join(", ")}`);
  }

  // The plot has the height that the legend does not need.
  resize(width, height) {
    const {root} = this.plot, other = [...root.querySelectorAll(".u-title, .u-legend")].reduce((sum, x) => sum + x.offsetHeight, 0);
    this.plot.setSize({width, height: Math.max(84, height - other - 6)});
  }

  draw(time) {
    this.time = time;
    const x = this.plot.valToPos(time, "x"), inside = x >= -1 && x <= this.plot.over.clientWidth + 1;
    this.line.style.display = inside ? "" : "none";
    this.line.style.transform = `translateX(${x}px)`;
    this.plot.setLegend({idx: 0}, false);
  }
}

// The whole time span, also for curves that end earlier.
const withTimeSpan = (tables, [low, high]) => [...tables, [[low, high], [null, null]]];

// All panes have the same range.
function zoom(panes, source) {
  const {min, max} = source.scales.x;
  for (const {plot} of panes) if (plot && plot !== source && (plot.scales.x.min !== min || plot.scales.x.max !== max)) plot.setScale("x", {min, max});
  panes.stale = true;
}

// All panes below each other, with equal heights.
function plot(scene, seek) {
  const box = document.getElementById("plots"), panes = [];
  document.querySelector("main").classList.toggle("bare", scene.panes.length === 0);
  for (const data of scene.panes) panes.push(new Pane(box, data, scene, panes, seek));
  let shown = NaN;
  return {
    panes,
    show(shown) { document.querySelector("main").classList.toggle("bare", !shown || scene.panes.length === 0); },
    resize(each = 0) {
      const style = getComputedStyle(box), width = box.clientWidth - parseFloat(style.paddingRight) - parseFloat(style.paddingLeft);
      const height = box.clientHeight - parseFloat(style.paddingTop) - parseFloat(style.paddingBottom);
      if (width > 0) for (const pane of panes) pane.resize(width, each || Math.max(height / panes.length, 170));
      shown = NaN;
    },
    draw(time) {
      if (time === shown && !panes.stale) return;
      panes.stale = false;
      for (const pane of panes) pane.draw(time);
      shown = time;
    },
  };
}
