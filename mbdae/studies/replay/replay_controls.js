
// The bar below the scene, keys, the legend, and the settings in the address.

const byId = id => document.getElementById(id);
const PACES = [0.1, 0.25, 0.5, 1, 2, 4, 10];

// A menu of the bar: its options and their action; returns a function that sets it.
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
  const changeSpeed = by => {
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
  const follow = menu("follow", [["", "fixed camera"], ...scene.bodies.map(({name}) => [name, `follow ${name}`])], "", view.follow);
  const show = marks(page.viewer, scene);
  page.mark = all => {
    page.marked = all;
    legend(scene.legend, show(all));
    view.arrange();
  };
  page.follow = name => {
    view.follow(name);
    follow(view.state.followed);
  };
  byId("play").onclick = page.toggle;
  byId("time").ariaLabel = scene.axis.name || "time";
  byId("time").oninput = event => page.seek(page.start + event.target.value * (scene.end - scene.start));
  byId("loop").onclick = repeat;
  byId("fit").onclick = fit;
  byId("more").onclick = () => document.querySelector("main").classList.toggle("more");
  const keys = {
    f: fit, c: () => page.mark(!page.marked), 1: () => view.look("front"), 2: () => view.look("top"),
    3: () => view.look("3d"), 4: () => view.look("side"),
  };
  if (!scene.sliders) Object.assign(keys, {
    " ": page.toggle, k: page.toggle, l: repeat, "<": () => changeSpeed(-1), ">": () => changeSpeed(1),
    ArrowLeft: event => page.step(event.shiftKey ? -10 : -1), ArrowRight: event => page.step(event.shiftKey ? 10 : 1),
    Home: () => page.seek(scene.start), End: () => page.seek(scene.end),
  });
  document.addEventListener("keydown", event => {
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    event.preventDefault();
    act(event);
  });
  document.addEventListener("keyup", event => { if (event.key === " ") event.preventDefault(); });  // no second click
}

function legend(entries, closures) {
  const names = closures.length > 4 ? [`${closures.length} closures: the balls coincide if a loop is closed`] : closures;
  const balls = names.map(text => ({colour: "linear-gradient(90deg, #f28e2b 50%, #e0263c 50%)", text}));
  byId("legend").replaceChildren(...[...entries, ...balls].map(({colour, text}) => {
    const [item, line, name] = ["li", "i", "span"].map(tag => document.createElement(tag));
    line.style.background = colour;
    name.append(text);
    item.append(line, name);
    return item;
  }));
}

// Settings in the address: #t=1.5&speed=0.1&camera=front&follow=BODY&plots=0&closures=1&autoplay=0&loop=0&shadows=0
function applyAddress(page, scene) {
  const settings = new URLSearchParams(location.hash.slice(1)), given = key => settings.has(key);
  const off = key => ["0", "false", "no"].includes(settings.get(key)), count = key => Number(settings.get(key));
  if (given("plots")) page.plots.show(!off("plots"));
  if (given("speed") && count("speed") > 0) page.setSpeed(count("speed"));
  if (settings.get("camera") in VIEWS) page.view.look(settings.get("camera"));
  if (given("follow")) page.follow(settings.get("follow"));
  if (given("closures")) page.mark(!off("closures"));
  if (given("loop")) [page.loop, byId("loop").ariaPressed] = [!off("loop"), String(!off("loop"))];
  if (given("shadows")) nodeOf(page.viewer, "Lights/Sun/<object>").castShadow = !off("shadows");
  const timed = !scene.sliders && given("t") && Number.isFinite(count("t"));
  if (timed) page.pauseAt(count("t"));
  const reduced = matchMedia("(prefers-reduced-motion: reduce)").matches;
  return given("autoplay") ? !off("autoplay") : !timed && !reduced;
}
