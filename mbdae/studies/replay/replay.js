// The player: one clock, in the solution's own time, moves the scene, the cursors and the controls.


// The fraction of the height that the caption covers.
const covered = () => Math.min(0.4, byId("caption").offsetHeight / byId("pane").clientHeight);

function player(viewer, scene) {
  const {start, end, frames, axis} = scene, direction = end < start ? -1 : 1, duration = Math.abs(end - start);
  const digits = duration > 0 ? Math.min(9, Math.max(2, Math.ceil(2.5 - Math.log10(duration)))) : 2;
  const view = cameras(viewer, scene, byId("pane"), covered), place = stage(viewer, scene);
  const plots = plot(scene, t => { page.seek(t); });
  let offset = 0, shown = NaN, moved = false, playing = false, before = null;
  const page = {
    viewer, start, duration, plots, view, show, speed: scene.speed, loop: true, choice: 0,
    get t() { return start + direction * offset; },
    get playing() { return playing; },
    play() {
      if (offset >= duration) offset = 0;
      playing = duration > 0 && !scene.sliders;
    },
    pause() { playing = false; },
    choose(which) {
      [page.choice, shown] = [which, NaN];
      show();
    },
    pauseAt(t) {
      playing = false;
      offset = Math.min(duration, Math.max(0, direction * (t - start)));
      show();
    },
    // Jump to a time, also if something else has moved the scene.
    jump(t) {
      [shown, moved] = [NaN, true];
      page.pauseAt(t);
    },
    seek(t) {
      page.pauseAt(t);
      viewer.render();
    },
    toggle() { (playing ? page.pause : page.play)(); },
    // Step by a number of frames.
    step(count) {
      const at = duration > 0 ? Math.round(offset / duration * (frames - 1)) : 0;
      page.seek(start + direction * duration * (at + count) / Math.max(1, frames - 1));
    },
  };
  function show() {
    const chosen = scene.choices[page.choice];
    if (offset !== shown) {
      place(offset, page.choice, moved);
      view.tick();
    }
    [shown, moved] = [offset, false];
    plots.draw(page.t);
    const pace = +page.speed.toPrecision(3), speed = pace === 1 ? "" : ` (${axis.name === "time" ? `${pace} × real time` : `${pace}/s`})`;
    const at = `${axis.clock}${page.t.toFixed(digits)}${axis.unit}${speed}`;
    const text = scene.sliders ? page.said || "" : `${at}${chosen ? `, ${chosen.name}` : ""}`;
    if (byId("clock").textContent !== text) byId("clock").textContent = text;
    byId("time").value = duration > 0 ? offset / duration : 0;
    byId("time").ariaValueText = text;
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

// Pictures of the whole page at evenly spaced times: frames first to last - 1 of count, as data in the page.
function film(page, scene, first, last, count) {
  const picture = document.createElement("canvas"), box = document.querySelector("main").getBoundingClientRect();
  [picture.width, picture.height] = [box.width, box.height];
  const c = picture.getContext("2d"), out = document.createElement("pre");
  const drawText = element => {
    if (!element.offsetParent) return;
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
    for (const element of document.querySelectorAll("#caption h1, #clock, #legend span, .u-title, .u-legend .u-label, .u-legend .u-value")) drawText(element);
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

// The page is loaded when the scene is built: an open inline frame delays its load event.
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
  const pane = byId("pane"), disableDrawing = withoutDrawing(), viewer = new MeshCat.Viewer(pane, false);
  disableDrawing(viewer);
  viewer.set_3d_pane_size = () => {};
  viewer.scene.rotation.set(0, 0, 0);  // z is up
  viewer.renderer.shadowMap.type = MeshCat.THREE.PCFShadowMap;
  const filming = location.hash.match(/^#film=(\d+),(\d+),(\d+),(\d+)x(\d+)$/);
  if (filming) {
    const main = document.querySelector("main");
    main.className = "film";
    [main.style.width, main.style.height] = [`${filming[4]}px`, `${filming[5]}px`];
  }
  build(viewer, scene);
  const page = player(viewer, scene), {view} = page;
  controls(page, scene);
  if (scene.sliders) sliders(page, scene);
  await null;  // plots are laid out
  page.show();
  view.look(scene.camera || scene.flat);
  page.mark(scene.marked);
  page.follow(scene.follow === null ? scene.far : scene.follow);
  let known = "";
  const arrange = () => {
    const size = `${pane.clientWidth} ${pane.clientHeight} ${byId("plots").clientHeight}`;
    if (size === known) return;
    known = size;
    page.plots.resize();
    view.arrange();
    page.show();
    if (window.mbdae) viewer.render();  // immediately: resizing clears the canvas
  };
  arrange();
  if (filming) {
    await new Promise(done => setTimeout(done));  // until plots have their size
    page.show();
    return film(page, scene, ...filming.slice(1, 4).map(Number));
  }
  page.pauseAt(scene.start);
  if (scene.sliders) page.slide(0);
  if (applyAddress(page, scene)) page.play();
  arrange();
  printed(page, arrange);
  viewer.render();
  window.mbdae = page;
  new ResizeObserver(arrange).observe(pane);
  window.addEventListener("hashchange", () => { if (applyAddress(page, scene)) page.play(); });
  requestAnimationFrame(page.tick);
}

const loaded = holdLoad();
main().catch(error => {
  byId("clock").textContent = `This page needs a browser with DecompressionStream: ${error}`;
  throw error;
}).finally(loaded);
