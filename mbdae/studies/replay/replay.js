// The player: one clock, in the solution's own time, moves the scene, the cursors and the controls.

const byId = id => document.getElementById(id);
const PACES = [0.1, 0.25, 0.5, 1, 2, 4, 10];

function player(viewer, scene) {
  const {start, end, frames} = scene, direction = end < start ? -1 : 1, duration = Math.abs(end - start);
  const digits = duration > 0 ? Math.min(9, Math.max(2, Math.ceil(2.5 - Math.log10(duration)))) : 2;
  const place = stage(viewer, scene), plots = plot(scene, t => { page.seek(t); });
  let offset = 0, shown = NaN, playing = false, before = null;
  const page = {
    viewer, start, duration, plots, show, speed: scene.speed, loop: true, choice: 0,
    get t() { return start + direction * offset; },
    get playing() { return playing; },
    play() {
      if (offset >= duration) offset = 0;
      playing = duration > 0;
    },
    pause() { playing = false; },
    choose(which) {
      [page.choice, shown] = [which, NaN];
      show();
    },
    seek(t) {
      playing = false;
      offset = Math.min(duration, Math.max(0, direction * (t - start)));
      show();
      viewer.render();
    },
    toggle() { (playing ? page.pause : page.play)(); },
    // Frames forth or back.
    step(count) {
      const at = duration > 0 ? Math.round(offset / duration * (frames - 1)) : 0;
      page.seek(start + direction * duration * (at + count) / Math.max(1, frames - 1));
    },
  };
  function show() {
    if (offset !== shown) place(duration > 0 ? offset / duration * (frames - 1) : 0, page.choice);
    shown = offset;
    plots.draw(page.t);
    const pace = page.speed === 1 ? "" : ` (${+page.speed.toPrecision(3)} × real time)`;
    const text = `t = ${page.t.toFixed(digits)} s${pace}`;
    if (byId("clock").textContent !== text) byId("clock").textContent = text;
    byId("time").value = duration > 0 ? offset / duration : 0;
    byId("play").classList.toggle("playing", playing);
    document.documentElement.dataset.t = page.t;
  }
  page.tick = now => {
    if (playing && before !== null) {
      offset += (now - before) / 1000 * page.speed;
      if (offset > duration && page.loop) offset %= duration;
      else if (offset > duration) [offset, playing] = [duration, false];
    }
    before = now;
    show();
    if (viewer.needs_render) viewer.render();
    requestAnimationFrame(page.tick);
  };
  return page;
}

function controls(page, scene, fit) {
  const speeds = byId("speed");
  for (const factor of PACES) {
    const speed = +(factor * scene.speed).toPrecision(12), text = `${+speed.toPrecision(3)}×`;
    speeds.append(new Option(text, speed, factor === 1, factor === 1));
  }
  const pace = by => {
    speeds.selectedIndex = Math.min(PACES.length - 1, Math.max(0, speeds.selectedIndex + by));
    page.speed = Number(speeds.value);
  };
  const repeat = () => {
    page.loop = !page.loop;
    byId("loop").setAttribute("aria-pressed", page.loop);
  };
  const choice = byId("choice");
  choice.hidden = scene.choices.length < 2;
  scene.choices.forEach(({name}, i) => choice.append(new Option(name, i)));
  choice.onchange = () => page.choose(Number(choice.value));
  byId("play").onclick = page.toggle;
  byId("time").oninput = event => page.seek(page.start + event.target.value * (scene.end - scene.start));
  byId("loop").onclick = repeat;
  byId("fit").onclick = fit;
  speeds.onchange = () => pace(0);
  const keys = {
    " ": page.toggle, k: page.toggle, l: repeat, f: fit, "<": () => pace(-1), ">": () => pace(1),
    ArrowLeft: event => page.step(event.shiftKey ? -10 : -1), ArrowRight: event => page.step(event.shiftKey ? 10 : 1),
    Home: () => page.seek(scene.start), End: () => page.seek(scene.end),
  };
  document.addEventListener("keydown", event => {
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey || [speeds, choice].includes(event.target)) return;
    event.preventDefault();
    act(event);
  });
  document.addEventListener("keyup", event => { if (event.key === " ") event.preventDefault(); });  // no second click
}

function legend(scene) {
  const entry = (colour, text) => {
    const [item, line, name] = ["li", "i", "span"].map(tag => document.createElement(tag));
    line.style.background = colour;
    name.append(text);
    item.append(line, name);
    byId("legend").append(item);
  };
  for (const ghost of scene.ghosts) entry(ghost.colour, ghost.name);
  for (const trace of scene.traces) entry(trace.colour, `path of ${trace.name}`);
  for (const force of scene.arrows.forces) entry(force.colour, `force of ${force.name}`);
  if (scene.arrows.forces.length) {
    byId("legend").lastChild.lastChild.append(`, longest ${scene.arrows.largest.toPrecision(3)} N`);
  }
}

// Pictures of the whole page at evenly spaced times: frames first to last - 1 of count, as data in the page.
function film(page, scene, first, last, count) {
  const picture = document.createElement("canvas"), box = document.querySelector("main").getBoundingClientRect();
  [picture.width, picture.height] = [box.width, box.height];
  const c = picture.getContext("2d"), out = document.createElement("pre");
  const words = element => {
    const style = getComputedStyle(element), spot = document.createRange();
    spot.selectNodeContents(element);
    const {left, top, height} = spot.getBoundingClientRect();
    c.font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
    c.fillStyle = style.color;
    c.textBaseline = "middle";
    c.fillText(element.textContent, left, top + height / 2);
  };
  for (let k = first; k < last; k++) {
    page.seek(scene.start + (scene.end - scene.start) * k / Math.max(1, count - 1));
    c.fillStyle = "#fff";
    c.fillRect(0, 0, picture.width, picture.height);
    for (const canvas of document.querySelectorAll("main canvas")) {
      const {left, top, width, height} = canvas.getBoundingClientRect();
      c.drawImage(canvas, left, top, width, height);
    }
    for (const element of document.querySelectorAll("#caption h1, #clock, #legend span")) words(element);
    for (const line of document.querySelectorAll("#legend i")) {
      const {left, top, width, height} = line.getBoundingClientRect();
      c.fillStyle = getComputedStyle(line).backgroundColor;
      c.fillRect(left, top, width, height);
    }
    out.append(picture.toDataURL("image/png"), "\n");
  }
  out.id = "film";
  out.hidden = true;
  document.body.append(out);
}

// The page counts as loaded once the scene stands: a frame that is still being written holds it back.
function holdLoad() {
  const frame = document.body.appendChild(document.createElement("iframe"));
  frame.hidden = true;
  frame.contentDocument.open();
  return () => frame.remove();
}

async function main() {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await unpack("viewer-data"));
  document.head.append(script);
  const scene = decode(await unpack("scene-data"));
  const pane = byId("pane"), viewer = new MeshCat.Viewer(pane, false), filled = viewer.set_3d_pane_size;
  viewer.set_3d_pane_size = () => filled.call(viewer, pane.clientWidth, pane.clientHeight);
  const shooting = location.hash.match(/^#film=(\d+),(\d+),(\d+),(\d+)x(\d+)$/);
  if (shooting) {
    const main = document.querySelector("main");
    main.className = "film";
    [main.style.width, main.style.height] = [`${shooting[4]}px`, `${shooting[5]}px`];
  }
  build(viewer, scene);
  furnish(viewer, scene.bounds);
  legend(scene);
  const page = window.mbdae = player(viewer, scene);
  let moved = false;
  const covered = () => Math.min(0.4, byId("caption").offsetHeight / pane.clientHeight);
  const fit = () => {
    moved = false;
    aim(viewer, scene.bounds, covered());
    viewer.set_dirty();
  };
  const arrange = () => {
    const {clientWidth: width, clientHeight: height} = pane;
    viewer.camera.setViewOffset(width, height, 0, -covered() * height / 2, width, height);
    viewer.set_3d_pane_size();
    page.plots.resize();
    if (!moved) fit();
    page.show();
    viewer.render();  // at once: what was drawn is gone with the old size
  };
  arrange();
  viewer.controls.addEventListener("start", () => { moved = true; });
  if (shooting) return film(page, scene, ...shooting.slice(1, 4).map(Number));
  new ResizeObserver(arrange).observe(pane);
  controls(page, scene, fit);
  const follow = () => {
    const found = location.hash.match(/[#&]t=([^&]+)/);
    const given = found !== null && Number.isFinite(Number(found[1]));
    if (given) page.seek(Number(found[1]));
    return given;
  };
  window.addEventListener("hashchange", follow);
  if (!follow()) {
    page.seek(scene.start);
    page.play();
  }
  requestAnimationFrame(page.tick);
}

const loaded = holdLoad();
main().catch(error => {
  byId("clock").textContent = `This page needs a browser with WebGL and DecompressionStream: ${error}`;
  throw error;
}).finally(loaded);
