
// The camera: presets, fit to the scene, following a body; its light and ground.

const VIEWS = {front: [0, -1, 0], top: [0, 0, 1], side: [1, 0, 0], "3d": null};

// The smallest and the largest of many numbers.
const extremes = numbers => numbers.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)], [Infinity, -Infinity]);

function cameras(viewer, scene, pane, covered) {
  const {Box3, OrthographicCamera, PerspectiveCamera, Vector3} = MeshCat.THREE, {flat, extent, visible} = scene;
  const pointsOf = name => Array.from({length: visible[name].length / 3}, (_, i) => new Vector3().fromArray(visible[name], 3 * i));
  const bodies = Object.fromEntries(scene.bodies.map(({name, path}) => [name, path]));
  const state = {view: "", followed: "", moved: false};
  let camera, controls, seen = pointsOf(""), last = new Vector3();
  const where = () => state.followed ? nodeOf(viewer, bodies[state.followed]).position : last.set(0, 0, 0);

  // The direction from the centre to the camera.
  const direction = view => {
    if (VIEWS[view]) return new Vector3(...VIEWS[view]);
    const leaning = {side: [1, -0.42, 0.34], front: [0.42, -1, 0.34], top: [-0.25, -0.75, 1], "3d": [0.9, -0.9, 0.55]};
    return new Vector3(...leaning[flat]).normalize();
  };

  function fit() {
    const back = direction(state.view), up = new Vector3(0, state.view === "top" ? 1 : 0, state.view === "top" ? 0 : 1);
    const right = up.clone().cross(back).normalize(), above = back.clone().cross(right);
    const aspect = pane.clientWidth / pane.clientHeight, middle = new Vector3(), share = 1 - covered();
    const box = new Box3().setFromPoints(seen), small = 0.02 * extent;
    box.getCenter(middle);
    let distance = 0;
    if (camera.isOrthographicCamera) {
      const spans = [right, above].map(axis => {
        const [low, high] = extremes(seen.map(p => p.dot(axis)));
        middle.addScaledVector(axis, (low + high) / 2 - middle.dot(axis));
        return Math.max(high - low, small);
      });
      const height = 1.14 * Math.max(spans[1] / share, spans[0] / aspect);
      Object.assign(camera, {top: height / 2, bottom: -height / 2, left: -height * aspect / 2, right: height * aspect / 2, zoom: 1});
      distance = 4 * extent;
      Object.assign(camera, {near: 0.01 * extent, far: 40 * extent});
    } else {
      const tangent = Math.tan(camera.fov * Math.PI / 360), [tanX, tanY] = [tangent * aspect, tangent * share];
      for (let k = 0; k < 8; k++) {
        distance = small;
        const at = seen.map(p => { const d = p.clone().sub(middle); return [d.dot(right), d.dot(above), d.dot(back)]; });
        for (const [x, y, z] of at) distance = Math.max(distance, z + Math.abs(x) / tanX, z + Math.abs(y) / tanY);
        for (const [i, axis] of [[0, right], [1, above]]) {
          const [low, high] = extremes(at.map(p => p[i] / (distance - p[2]))), off = (low + high) / 2;
          if (k < 7) middle.addScaledVector(axis, off * distance);
        }
      }
      distance *= 1.07;
      Object.assign(camera, {near: Math.max(distance - 3 * extent, 0.03 * distance), far: distance + 30 * extent});
    }
    middle.add(where());
    camera.position.copy(middle).addScaledVector(back, distance);
    controls.target.copy(middle);
    controls.update();
    state.moved = false;
  }

  function look(view) {
    if (!(view in VIEWS)) return;
    if (controls) controls.dispose();
    camera = VIEWS[view] ? new OrthographicCamera(-1, 1, 1, -1, 0.1, 10) : new PerspectiveCamera(32, 1, 0.1, 10);
    camera.up.set(0, view === "top" ? 1 : 0, view === "top" ? 0 : 1);
    viewer.set_camera(camera);
    controls = viewer.controls;
    controls.addEventListener("start", () => { state.moved = true; });
    state.view = view;
    arrange();
    pane.dispatchEvent(new CustomEvent("looked"));
  }

  // The scene is visible in the area below the caption.
  function arrange() {
    const {clientWidth: width, clientHeight: height} = pane;
    camera.setViewOffset(width, height, 0, -covered() * height / 2, width, height);
    if (!state.moved) fit();
    if (camera.isOrthographicCamera) {
      const half = (camera.top - camera.bottom) / 2 * width / height;
      Object.assign(camera, {left: -half, right: half});
    } else camera.aspect = width / height;
    camera.updateProjectionMatrix();
    viewer.renderer.setSize(width, height);
    tick();
    viewer.set_dirty();
  }

  function follow(name) {
    state.followed = name in bodies ? name : "";
    seen = pointsOf(state.followed);
    last = where().clone();
    fit();
    tick();
    viewer.set_dirty();
  }

  // Camera, light and ground move with a followed body.
  function tick() {
    if (!camera) return;
    if (state.followed) {
      const step = where().clone().sub(last);
      camera.position.add(step);
      controls.target.add(step);
      last.add(step);
    }
    shine(viewer, scene, controls.target, state.view, direction(state.view));
  }

  return {state, look, follow, fit, arrange, tick, get camera() { return camera; }};
}

// The light is next to the preset of the camera and points to its target; the ground is below the target, or a board
// behind the scene in views from the front or the side.
function shine(viewer, {extent, levels, cell}, target, view, back) {
  const {Vector3} = MeshCat.THREE, sun = nodeOf(viewer, "Lights/Sun/<object>"), ground = nodeOf(viewer, "ground");
  const leaning = {front: [-0.35, -1, 0.5], side: [1, -0.35, 0.5], top: [-0.3, 0.35, 1], "3d": [-0.25, -0.35, 1]}[view];
  const light = new Vector3(...leaning).add(view === "3d" ? back.clone().multiplyScalar(0.3) : new Vector3()).normalize();
  sun.position.copy(target).addScaledVector(light, 3 * extent);
  sun.target.position.copy(target);
  sun.target.updateMatrixWorld();
  ground.position.fromArray(target.toArray().map(x => Math.round(x / cell) * cell));
  ground.position.setComponent({side: 0, front: 1}[view] ?? 2, levels[view]);
  ground.rotation.set(view === "front" ? Math.PI / 2 : 0, view === "side" ? Math.PI / 2 : 0, 0);
}
