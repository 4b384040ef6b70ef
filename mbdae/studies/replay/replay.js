// The player: one clock, in the solution's own time, moves the scene, the cursors and the controls.

const byId = id => document.getElementById(id);
const PACES = [0.1, 0.25, 0.5, 1, 2, 4, 10];

// What part of the height the caption covers.
const covered = () => Math.min(0.4, byId("caption").offsetHeight / byId("pane").clientHeight);

function player(viewer, scene) {
  const {start, end, frames} = scene, direction = end < start ? -1 : 1, duration = Math.abs(end - start);
  const digits = duration > 0 ? Math.min(9, Math.max(2, Math.ceil(2.5 - Math.log10(duration)))) : 2;
  const view = cameras(viewer, scene, byId("pane"), covered), place = stage(viewer, scene, view.state.extent);
  const plots = plot(scene, t => { page.seek(t); });
  let offset = 0, shown = NaN, playing = false, before = null;
  const page = {
    viewer, start, duration, plots, view, show, speed: scene.speed, loop: true, choice: 0,
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
    stand(t) {
      playing = false;
      offset = Math.min(duration, Math.max(0, direction * (t - start)));
      show();
    },
    seek(t) {
      page.stand(t);
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
    if (offset !== shown) {
      place(duration > 0 ? offset / duration * (frames - 1) : 0, page.choice);
      view.tick();
    }
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

// A choice of the bar: its options, what one of them does, and how it is set from elsewhere.
function menu(id, options, chosen, act) {
  const select = byId(id);
  for (const [value, text] of options) select.append(new Option(text, value, value === chosen, value === chosen));
  select.hidden = options.length < 2;
  select.onchange = () => act(select.value);
  return value => {
    if (![...select.options].some(option => option.value === String(value))) select.append(new Option(value, value));
    select.value = value;
  };
}

function controls(page, scene) {
  const speeds = byId("speed"), text = speed => `${+speed.toPrecision(3)}×`;
  const paces = PACES.map(factor => +(factor * scene.speed).toPrecision(12));
  menu("speed", paces.map(speed => [speed, text(speed)]), scene.speed, value => { page.speed = Number(value); });
  const pace = by => {
    const near = paces.findIndex(speed => speed >= page.speed * (1 - 1e-9));
    page.setSpeed(paces[Math.min(PACES.length - 1, Math.max(0, (near < 0 ? PACES.length : near) + by))]);
  };
  page.setSpeed = speed => {
    page.speed = speed;
    if (![...speeds.options].some(option => Number(option.value) === speed)) speeds.append(new Option(text(speed), speed));
    speeds.value = speed;
    page.show();
  };
  const repeat = () => {
    page.loop = !page.loop;
    byId("loop").setAttribute("aria-pressed", page.loop);
  };
  const {view} = page, fit = () => {
    view.fit();
    page.viewer.set_dirty();
  };
  menu("choice", scene.choices.map(({name}, i) => [i, name]), 0, value => page.choose(Number(value)));
  const camera = menu("camera", Object.keys(VIEWS).map(name => [name, name]), view.state.view, view.look);
  byId("pane").addEventListener("looked", () => camera(view.state.view));
  const follow = menu("follow", [["", "stand still"], ...scene.bodies.map(({name}) => [name, `follow ${name}`])], "", view.follow);
  const {show} = marks(page.viewer, scene, view.state.extent);
  page.mark = all => {
    page.marked = all;
    legend(scene, show(all));
    view.arrange();
  };
  page.follow = name => {
    view.follow(name);
    follow(view.state.followed);
  };
  byId("play").onclick = page.toggle;
  byId("time").oninput = event => page.seek(page.start + event.target.value * (scene.end - scene.start));
  byId("loop").onclick = repeat;
  byId("fit").onclick = fit;
  byId("more").onclick = () => document.querySelector("main").classList.toggle("more");
  const keys = {
    " ": page.toggle, k: page.toggle, l: repeat, f: fit, "<": () => pace(-1), ">": () => pace(1),
    c: () => page.mark(!page.marked), 1: () => view.look("front"), 2: () => view.look("top"), 3: () => view.look("3d"),
    4: () => view.look("side"),
    ArrowLeft: event => page.step(event.shiftKey ? -10 : -1), ArrowRight: event => page.step(event.shiftKey ? 10 : 1),
    Home: () => page.seek(scene.start), End: () => page.seek(scene.end),
  };
  document.addEventListener("keydown", event => {
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    event.preventDefault();
    act(event);
  });
  document.addEventListener("keyup", event => { if (event.key === " ") event.preventDefault(); });  // no second click
}

function legend(scene, closures) {
  byId("legend").replaceChildren();
  const entry = (colour, text) => {
    const [item, line, name] = ["li", "i", "span"].map(tag => document.createElement(tag));
    line.style.background = colour;
    name.append(text);
    item.append(line, name);
    byId("legend").append(item);
  };
  for (const ghost of scene.ghosts) entry(ghost.colour, ghost.name);
  for (const trace of scene.traces) entry(trace.colour, `path of ${trace.name}`);
  scene.arrows.forces.forEach(({colour, name}, i) => {
    entry(colour, `force of ${name}${i ? "" : `, longest ${scene.arrows.largest.toPrecision(3)} N`}`);
  });
  const many = closures.length > 4 ? [`${closures.length} closures: the balls meet where a loop is closed`] : closures;
  for (const name of many) entry("linear-gradient(90deg, #f28e2b 50%, #e0263c 50%)", name);
}

// What the address says: #t=1.5&speed=0.1&camera=front&follow=BODY&plots=0&closures=1&autoplay=0&loop=0&shadows=0
function obey(page, scene) {
  const said = new URLSearchParams(location.hash.slice(1)), given = key => said.has(key);
  const off = key => ["0", "false", "no"].includes(said.get(key)), count = key => Number(said.get(key));
  if (given("plots")) page.plots.show(!off("plots"));
  if (given("speed") && count("speed") > 0) page.setSpeed(count("speed"));
  if (said.get("camera") in VIEWS) page.view.look(said.get("camera"));
  if (given("follow")) page.follow(said.get("follow"));
  if (given("closures")) page.mark(!off("closures"));
  if (given("loop")) [page.loop, byId("loop").ariaPressed] = [!off("loop"), String(!off("loop"))];
  if (given("shadows")) nodeOf(page.viewer, "mechanism").sun.castShadow = !off("shadows");
  const timed = given("t") && Number.isFinite(count("t"));
  if (timed) page.stand(count("t"));
  return given("autoplay") ? !off("autoplay") : !timed;
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
    for (const element of document.querySelectorAll("#caption h1, #clock, #legend span, .u-title, .u-legend .u-label, .u-legend .u-value")) words(element);
    for (const line of document.querySelectorAll("#legend i, .u-marker, .now")) {
      const {left, top, width, height} = line.getBoundingClientRect();
      c.fillStyle = getComputedStyle(line).backgroundColor || "#0000";
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
  for (const id of ["viewer-data", "plots-data"]) {
    const script = document.createElement("script");
    script.textContent = new TextDecoder().decode(await unpack(id));
    document.head.append(script);
  }
  const scene = decode(await unpack("scene-data"));
  const pane = byId("pane"), viewer = new MeshCat.Viewer(pane, false);
  viewer.set_3d_pane_size = () => {};
  viewer.scene.rotation.set(0, 0, 0);  // z is up
  const shooting = location.hash.match(/^#film=(\d+),(\d+),(\d+),(\d+)x(\d+)$/);
  if (shooting) {
    const main = document.querySelector("main");
    main.className = "film";
    [main.style.width, main.style.height] = [`${shooting[4]}px`, `${shooting[5]}px`];
  }
  build(viewer, scene);
  const page = player(viewer, scene), {view} = page;
  controls(page, scene);
  await null;  // plots are laid out
  page.show();
  view.look(scene.camera || view.flat);
  page.mark(scene.marked);
  page.follow(scene.follow === null ? view.far : scene.follow);
  let known = "";
  const arrange = () => {
    const size = `${pane.clientWidth} ${pane.clientHeight} ${byId("plots").clientHeight}`;
    if (size === known) return;
    known = size;
    page.plots.resize();
    view.arrange();
    page.show();
    if (window.mbdae) viewer.render();  // at once: what was drawn is gone with the old size
  };
  arrange();
  if (shooting) return film(page, scene, ...shooting.slice(1, 4).map(Number));
  page.stand(scene.start);
  if (obey(page, scene)) page.play();
  arrange();
  viewer.render();
  window.mbdae = page;
  new ResizeObserver(arrange).observe(pane);
  window.addEventListener("hashchange", () => { if (obey(page, scene)) page.play(); });
  requestAnimationFrame(page.tick);
}

const loaded = holdLoad();
main().catch(error => {
  byId("clock").textContent = `This page needs a browser with WebGL and DecompressionStream: ${error}`;
  throw error;
}).finally(loaded);
