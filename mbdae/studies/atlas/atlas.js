"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const RUN = ["model", "method", "rtol", "n", "q", "v", "lam", "g", "Gv", "energy", "steps", "rejected", "solves", "f", "factorizations", "seconds", "status"];
const WORKS = ["solves", "f", "seconds"], WORK_LABELS = ["linear solves", "evaluations of f", "CPU time in s"];
const FIRST = 60;  // rows of a table that are shown at once
const EQUAL = 1.01;  // counts within this ratio are taken as equal
const $ = id => document.getElementById(id);
const state = { model: "", quantity: "q", low: -13, high: 1, work: 0, method: "" };
const shown = { runs: FIRST, long: FIRST, failed: FIRST };
const sorted = { runs: ["model", 1], long: ["model", 1], failed: ["model", 1] };
const families = () => new Set([...document.querySelectorAll("[name=family]:checked")].map(x => x.value));
const familyOf = Object.fromEntries(data.methods.map(m => [m.name, m.family]));
const models = Object.fromEntries(data.models.map(m => [m.name, m]));
const methods = Object.fromEntries(data.methods.map(m => [m.name, m]));

function tag(name, attributes = {}, ...children) {
  const svg = ["svg", "g", "line", "circle", "polyline", "text", "title"].includes(name);
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "style") element.style.setProperty("--c", value);
    else if (value !== null) element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
}

const records = data.runs.map(row => {
  const run = Object.fromEntries(RUN.map((name, i) => [name, row[i]]));
  return { ...run, model: data.models[run.model].name, method: data.methods[run.method].name, setting: run.rtol ?? run.n };
});
const format = x => x === null || x === undefined ? "-" : Number.isInteger(x) ? String(x) : x === 0 ? "0" : x.toExponential(1);
const amount = (x, work) => work === 2 ? (x < 1 ? `${(1000 * x).toPrecision(3)} ms` : `${x.toPrecision(3)} s`) : x.toPrecision(3) >= 1000 ? String(Math.round(x)) : x.toPrecision(3);
const power = k => `1e${k}`;
const byName = (model, method) => (!state.model || model === state.model) && (!method || method.includes(state.method));
const chosen = (allowed, method) => allowed.has(familyOf[method]) && method.includes(state.method);

function commandOf(run) {
  const setting = run.rtol === null ? `--steps ${run.n}` : `--rtol ${run.rtol.toExponential()}`;
  return `mbdae compare ${models[run.model].argument} -m ${methods[run.method].argument} ${setting} --backend ${data.backend}`;
}
const longCommand = x => `mbdae drift ${models[x.model].argument} -m ${methods[x.method].argument} --step ${x.step} -t ${x.end}`;

function show(command, text) {
  const box = $("command"), [copy, close] = box.querySelectorAll("button");
  box.querySelector("p").textContent = text;
  box.querySelector("code").textContent = command;
  copy.textContent = "Copy";
  copy.onclick = async () => { copy.textContent = await copied(command) ? "Copied" : "Select the text to copy it"; };
  close.onclick = () => { box.hidden = true; };
  box.hidden = false;
}
async function copied(text) {
  try { await navigator.clipboard.writeText(text); return true; } catch { /* denied: fall back to execCommand */ }
  const area = tag("textarea");
  area.value = text;
  document.body.append(area);
  area.select();
  const done = document.execCommand("copy");
  area.remove();
  return done;
}
function describe(run) {
  const errors = Object.entries(data.quantities).map(([name, unit]) => `${name} ${format(run[name])} ${unit}`).join("; ");
  return `${run.model}, ${run.method}: ${run.q === null ? run.status : `errors ${errors}`}; ${run.solves} solves`;
}

function dot(method) { return tag("i", { style: methods[method].colour }); }

function drawWins(allowed) {
  const table = $("wins").querySelector("table"), wins = new Map();
  const powers = [];
  for (let k = state.high; k >= state.low; k--) powers.push(k);
  const ranked = data.models.filter(m => !state.model || m.name === state.model).map(m => [m, m.ranks[state.quantity]]);
  const used = powers.filter(k => ranked.some(([, ranks]) => ranks.some(r => Math.round(Math.log10(r[0])) === k)));
  const rows = ranked.map(([m, ranks]) => tag("tr", {}, tag("td", {}, tag("button", { onclick: () => choose("model", m.name) }, m.name)),
    ...used.map(k => winCell(m, ranks.find(r => Math.round(Math.log10(r[0])) === k), allowed, wins))));
  table.replaceChildren(tag("tr", {}, tag("th", {}, "model"), ...used.map(k => tag("th", { class: "text" }, power(k)))), ...rows);
  const score = [...wins].sort((a, b) => b[1] - a[1]).map(([name, n]) => tag("span", {}, dot(name), `${name} ${n}`, "  "));
  $("score").replaceChildren(`Wins, ${WORK_LABELS[state.work]}: `, ...(score.length ? score : ["none"]));
}
function winCell(m, rank, allowed, wins) {
  const entries = rank ? rank[1 + state.work].filter(([i]) => chosen(allowed, data.methods[i].name)) : [];
  if (!entries.length) return tag("td", { class: "text" }, "-");
  const [best, least, bound] = entries[0], name = data.methods[best].name;
  const ratio = state.work === 2 ? data.noise : EQUAL;
  const also = entries.slice(1).filter(e => e[1] <= ratio * least).map(e => data.methods[e[0]].name);
  wins.set(name, (wins.get(name) ?? 0) + 1);
  const rest = also.length ? [tag("span", { class: "also" }, ` or ${also.slice(0, 2).join(", ")}${also.length > 2 ? ` and ${also.length - 2} more` : ""}`)] : [];
  const list = entries.map(e => `${data.methods[e[0]].name} ${e[2] ? "≤ " : ""}${amount(e[1], state.work)}`).join("\n");
  return tag("td", { class: "text", title: list }, tag("button", { onclick: () => { state.method = $("method").value = name; choose("model", m.name); location.hash = "runs"; } },
    dot(name), name), ` ${bound ? "≤ " : ""}${amount(least, state.work)}`, ...rest);
}

function inRange(run) {
  const error = run[state.quantity];
  return error !== null && error >= 0.999 * 10 ** state.low && error <= 1.001 * 10 ** state.high;
}
function selected(allowed) {
  return records.filter(r => byName(r.model, r.method) && allowed.has(familyOf[r.method]) && inRange(r));
}

function drawChart(runs) {
  const work = WORKS[state.work], points = runs.filter(r => r[work] > 0 && r[state.quantity] > 0), m = models[state.model];
  const unit = data.quantities[state.quantity];
  $("trust").textContent = m ? `${m.title}, 0 to ${m.duration} s; reference ${m.reference}, checked by ${m.cross_check}: errors of ${state.quantity} below ${format(m.floors[state.quantity])} are not known.`
    : "All models together: select one for its curves.";
  if (!points.length) { $("plot").replaceChildren(tag("p", {}, "No run has an error in this range.")); $("key").replaceChildren(); return; }
  const W = Math.max(300, Math.min(960, $("plot").clientWidth)), H = Math.max(320, Math.round(0.53 * W)), L = 56, B = 44, logs = points.map(r => [Math.log10(r[work]), Math.log10(r[state.quantity])]);
  const limits = i => { const all = logs.map(p => p[i]); return [Math.floor(Math.min(...all) - 1e-9), Math.ceil(Math.max(...all) + 1e-9)]; };
  const [x0, x1] = limits(0), [y0, y1] = limits(1);
  const X = x => L + (W - L - 12) * (x - x0) / (x1 - x0), Y = y => 12 + (H - B - 12) * (y1 - y) / (y1 - y0);
  const svg = tag("svg", { viewBox: `0 0 ${W} ${H}`, width: W, height: H, role: "img", "aria-label": "error over work" });
  for (let k = x0; k <= x1; k++) svg.append(tag("line", { class: "grid", x1: X(k), x2: X(k), y1: Y(y1), y2: Y(y0) }), tag("text", { x: X(k), y: H - B + 18, "text-anchor": "middle" }, power(k)));
  for (let k = y0; k <= y1; k++) svg.append(tag("line", { class: "grid", x1: X(x0), x2: X(x1), y1: Y(k), y2: Y(k) }), tag("text", { x: L - 6, y: Y(k) + 4, "text-anchor": "end" }, power(k)));
  svg.append(tag("text", { x: (W + L) / 2, y: H - 6, "text-anchor": "middle" }, WORK_LABELS[state.work]),
    tag("text", { x: 14, y: (H - B) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(H - B) / 2})` }, `error of ${state.quantity} (${unit})`));
  const names = [...new Set(points.map(r => r.method))];
  if (m) for (const name of names) {
    const curve = points.flatMap((r, i) => r.method === name ? [`${X(logs[i][0])},${Y(logs[i][1])}`] : []);
    svg.append(tag("polyline", { points: curve.join(" "), style: methods[name].colour }));
  }
  points.forEach((r, i) => {
    const open = () => show(commandOf(r), describe(r));
    svg.append(tag("circle", { class: "run", cx: X(logs[i][0]), cy: Y(logs[i][1]), r: m ? 5 : 3, style: methods[r.method].colour, tabindex: m ? 0 : null, onclick: open,
      onkeydown: e => { if (e.key === "Enter") open(); } }, tag("title", {}, describe(r))));
  });
  $("plot").replaceChildren(svg);
  $("key").replaceChildren(...names.map(name => tag("span", {}, dot(name), name)));
}

const columns = {
  runs: [["model"], ["method"], ["setting", "rtol or steps"], ["q", "error q"], ["v", "error v"], ["lam", "error lam"], ["g", "|g|"], ["Gv", "|G v|"], ["energy"], ["steps"], ["solves"], ["f"], ["factorizations", "fact."], ["seconds", "CPU s"]],
  long: [["model"], ["method"], ["step", "step in s"], ["trend", "trend, J/s"], ["trend_error", "± J/s"], ["rate", "rate at most, 1/s"], ["energy", "largest error"], ["g", "|g|"], ["Gv", "|G v|"], ["solves"], ["status"]],
  failed: [["model"], ["method"], ["setting"], ["status"], ["reason"]],
};
function compareBy(key, sign) {
  return (a, b) => {
    const x = a[key], y = b[key], none = z => z === null || z === undefined;
    if (none(x) || none(y)) return none(x) - none(y);
    return sign * (typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y)));
  };
}
function drawTable(id, rows, command) {
  const [key, sign] = sorted[id], section = $(id), heads = columns[id];
  const order = [...rows].sort(compareBy(key, sign)), texts = ["method", "status", "reason"];
  const head = tag("tr", {}, ...heads.map(([name, word]) => tag("th", { class: texts.includes(name) ? "text" : null, "aria-sort": name === key ? (sign > 0 ? "ascending" : "descending") : null },
    tag("button", { onclick: () => { sorted[id] = [name, name === key ? -sign : 1]; draw(); } }, (word ?? name) + (name === key ? (sign > 0 ? " ↑" : " ↓") : "")))), ...(command ? [tag("th", { class: "text" }, "repeat")] : []));
  const body = order.slice(0, shown[id]).map(row => tag("tr", {}, ...heads.map(([name]) => cell(name, row[name])),
    ...(command ? [tag("td", { class: "text" }, tag("button", { onclick: () => show(command(row), `${row.model}, ${row.method}`) }, "command"))] : [])));
  section.querySelector("table").replaceChildren(head, ...body);
  section.querySelector(".more").hidden = order.length <= shown[id];
  return order.length;
}
function cell(name, value) {
  if (name === "method" && value) return tag("td", { class: "text" }, ...(methods[value] ? [dot(value)] : []), value);
  if (name === "reason") return tag("td", { class: "reason" }, value);
  const text = typeof value === "string" ? value : name === "setting" && value < 1 ? value.toExponential() : format(value);
  return tag("td", { class: name === "status" ? "text" : null }, text);
}

const failures = data.failed.map(([model, method, setting, status, reason]) => ({ model, method, setting, status, reason }));
function draw() {
  const allowed = families(), runs = selected(allowed);
  drawWins(allowed);
  drawChart(runs);
  const n = drawTable("runs", runs, commandOf);
  $("runs").querySelector(".note").textContent = `${n} runs with an error of ${state.quantity} in the range; a click on a heading sorts. Errors are the largest over 20 common times; |g| and |G v| over all rows and steps.`;
  drawTable("long", data.long.filter(x => byName(x.model, x.method) && allowed.has(familyOf[x.method])), longCommand);
  const failed = failures.filter(x => byName(x.model, x.method) && (!familyOf[x.method] || allowed.has(familyOf[x.method])));
  const counts = new Map();
  for (const x of failed) counts.set(x.status, (counts.get(x.status) ?? 0) + 1);
  $("failed").querySelector(".note").textContent = `Runs that ended early or warn, and methods that do not suit a model (omitted): ${[...counts].map(([k, v]) => `${k} ${v}`).join(", ") || "none"}.`;
  drawTable("failed", failed, null);
}
function choose(name, value) {
  state[name] = value;
  $(name).value = value;
  draw();
}

function fill(id, values, words = values) {
  $(id).append(...values.map((x, i) => tag("option", { value: x }, words[i])));
  $(id).value = state[id];
}
const errors = records.map(r => r.q).filter(x => x > 0).map(Math.log10);
const [lowest, highest] = errors.length ? [Math.floor(Math.min(...errors)), Math.min(Math.ceil(Math.max(...errors)), 3)] : [-12, 0];
state.low = lowest;
state.high = highest;
const scale = Array.from({ length: highest - lowest + 1 }, (_, i) => lowest + i);
fill("model", data.models.map(m => m.name));
fill("quantity", Object.keys(data.quantities));
fill("low", scale, scale.map(power));
fill("high", scale, scale.map(power));
if (data.models.length === 1) choose("model", data.models[0].name);
for (const id of ["model", "quantity"]) $(id).addEventListener("change", e => choose(id, e.target.value));
for (const id of ["low", "high", "work"]) $(id).addEventListener("change", e => choose(id, Number(e.target.value)));
$("method").addEventListener("input", e => choose("method", e.target.value.trim()));
for (const box of document.querySelectorAll("[name=family]")) box.addEventListener("change", draw);
$("filter").addEventListener("submit", e => e.preventDefault());
let width = 0;
new ResizeObserver(() => { if ($("plot").clientWidth !== width) { width = $("plot").clientWidth; draw(); } }).observe($("plot"));
for (const id of Object.keys(shown)) $(id).querySelector(".more").addEventListener("click", () => { shown[id] *= 4; draw(); });
draw();
