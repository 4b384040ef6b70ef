
// The camera: presets, fit to the scene, following a body; its light and ground.

const VIEWS = {front: [0, -1, 0], top: [0, 0, 1], side: [1, 0, 0], "3d": null};
const FRAMES_SEEN = 60;

// The smallest and the largest of many numbers.
const extremes = numbers => numbers.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)], [Infinity, -Infinity]);

// Points that must be visible: corners of the boxes of moving shapes at some frames, relative to a followed body, and
// of resting shapes close to them; resting shapes are ignored if a body is followed.
function visiblePoints(scene, path) {
  const {Box3, Quaternion, Vector3} = MeshCat.THREE, turn = new Quaternion();
  const points = [];
  const leader = path && scene.poses.find(pose => pose.path === path);
  const origin = at => leader ? new Vector3().fromArray(leader.values, leader.values.length > 7 ? 7 * at : 0) : new Vector3();
  const corners = ({values, box: [low, high]}, at, out) => {
    turn.fromArray(values, 7 * at + 3);
    const place = new Vector3().fromArray(values, 7 * at);
    if (Number.isNaN(place.x)) return;
    for (let k = 0; k < 8; k++) {
      const corner = new Vector3(...low.map((x, i) => (k >> i & 1 ? high[i] : x)));
      out.push(corner.applyQuaternion(turn).add(place));
    }
  };
  const counted = scene.poses.filter(pose => !/^\/mechanism\/(rail|closure)\//.test(pose.path));
  const moving = [...counted, ...scene.choices.flatMap(({poses}) => poses)].filter(pose => pose.values.length > 7 && pose.box);
  const count = Math.max(12, Math.round(FRAMES_SEEN / Math.max(1, scene.choices.length)));
  for (let k = 0; k < count; k++) {
    const own = [], share = k / (count - 1), frame = (values, width) => Math.round(share * (values.length / width - 1));
    for (const pose of moving) corners(pose, frame(pose.values, 7), own);
    for (const {ends} of scene.springs) {
      if (ends.length > 6) own.push(mixed(ends, 6, 0, frame(ends, 6)), mixed(ends, 6, 3, frame(ends, 6)));
    }
    const here = leader ? origin(frame(leader.values, 7)) : origin(0);
    for (const p of own) points.push(p.sub(here));
  }
  const near = new Box3().setFromPoints(points), all = [];
  for (const pose of counted) if (pose.values.length === 7) corners(pose, 0, all);
  if (!points.length) return {points: all.length ? all : [new Vector3(-0.5, -0.5, -0.5), new Vector3(0.5, 0.5, 0.5)], near};
  if (!leader) {
    const reach = near.clone().expandByScalar(0.2 * near.getSize(new Vector3()).length());
    for (const p of all) points.push(reach.clampPoint(p, new Vector3()));
  }
  return {points, near};
}

// The preset normal to the plane of a planar motion; 3d for a spatial one.
function planeView({points}) {
  const size = new MeshCat.THREE.Box3().setFromPoints(points).getSize(new MeshCat.THREE.Vector3()).toArray();
  const widest = Math.max(...size), thin = size.indexOf(Math.min(...size));
  return size[thin] < 0.3 * widest ? ["side", "front", "top"][thin] : "3d";
}

function cameras(viewer, scene, pane, covered) {
  const {Box3, OrthographicCamera, PerspectiveCamera, Vector3} = MeshCat.THREE;
  const whole = visiblePoints(scene, null), extent = new Box3().setFromPoints(whole.points).getSize(new Vector3()).length() || 1;
  const bodies = Object.fromEntries(scene.bodies.map(({name, path}) => [name, path]));
  const flat = planeView(whole), state = {view: "", followed: "", moved: false, extent};
  let camera, controls, seen = whole, last = new Vector3();
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
    const box = new Box3().setFromPoints(seen.points), small = 0.02 * extent;
    box.getCenter(middle);
    let distance = 0;
    if (camera.isOrthographicCamera) {
      const spans = [right, above].map(axis => {
        const [low, high] = extremes(seen.points.map(p => p.dot(axis)));
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
        const at = seen.points.map(p => { const d = p.clone().sub(middle); return [d.dot(right), d.dot(above), d.dot(back)]; });
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
    ground(viewer, scene, view, extent);
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
    seen = state.followed ? visiblePoints(scene, bodies[name]) : whole;
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
    shine(viewer, controls.target, extent, state.view, direction(state.view));
  }

  // A mechanism that travels far beyond its size is followed.
  const [first] = scene.bodies, size = points => new Box3().setFromPoints(points).getSize(new Vector3()).length();
  const far = first && size(whole.near ? whole.points : []) > 2.5 * size(visiblePoints(scene, first.path).points);
  return {state, look, follow, fit, arrange, tick, flat, far: far ? first.name : "", get camera() { return camera; }};
}

// A light with shadows, the sky, and the ground: a floor, or a board behind the scene in views from the front or the
// side.
function ground(viewer, scene, view, extent) {
  const {Box3, CircleGeometry, Color, DirectionalLight, Float32BufferAttribute, Group, HemisphereLight, LineBasicMaterial,
    LineSegments, BufferGeometry, Mesh, MeshLambertMaterial, PCFShadowMap, Vector3} = MeshCat.THREE;
  const root = nodeOf(viewer, "mechanism");
  if (root.sun === undefined) {
    for (const path of ["Lights", "Grid", "Axes"]) viewer.delete_path([path]);
    root.sun = new DirectionalLight(0xffffff, 0.5);
    Object.assign(root.sun, {castShadow: true});
    viewer.renderer.shadowMap.type = PCFShadowMap;
    root.sun.shadow.mapSize.set(2048, 2048);
    root.add(root.sun, root.sun.target, new HemisphereLight(0xffffff, 0xc4c8cf, 0.68));
    viewer.set_property(["Background"], "top_color", [0.97, 0.98, 0.99]);
    viewer.set_property(["Background"], "bottom_color", [0.86, 0.885, 0.91]);
  }
  if (root.floor) root.remove(root.floor);
  const all = new Box3();
  for (const {values, box, path} of scene.poses) {
    if (path.includes("/closure/")) continue;
    const q = new MeshCat.THREE.Quaternion();
    for (let at = 0; at < values.length; at += 7 * Math.max(1, Math.floor(values.length / 700))) {
      if (Number.isNaN(values[at])) continue;
      const own = new Box3(new Vector3(...box[0]), new Vector3(...box[1]));
      const m = new MeshCat.THREE.Matrix4().compose(new Vector3().fromArray(values, at), q.fromArray(values, at + 3), new Vector3(1, 1, 1));
      all.union(own.applyMatrix4(m));
    }
  }
  if (all.isEmpty()) all.set(new Vector3(-0.5, -0.5, -0.5), new Vector3(0.5, 0.5, 0.5));
  const floor = root.floor = new Group(), radius = 5 * extent, decade = 10 ** Math.floor(Math.log10(extent / 5));
  const cell = decade * ([5, 2].find(k => k * decade <= extent / 5) || 1), cells = Math.floor(radius / cell);
  const disc = new CircleGeometry(radius, 64), lit = new Mesh(disc, new MeshLambertMaterial({color: 0xf6f7f9, transparent: true, opacity: 0.62, depthWrite: false}));
  lit.receiveShadow = true;
  const lines = [], tints = [], line = new Color(0xa9b3bd);
  const fade = (x, y) => Math.max(0, 1 - Math.hypot(x, y) / radius) ** 1.5;
  for (let i = -cells; i <= cells; i++) {
    for (let j = -cells; j < cells; j++) {
      for (const [a, b, c, d] of [[i, j, i, j + 1], [j, i, j + 1, i]]) {
        if (Math.hypot(a, b) > cells || (cells > 30 && i % 2)) continue;
        lines.push(a * cell, b * cell, 0, c * cell, d * cell, 0);
        for (const [x, y] of [[a, b], [c, d]]) tints.push(line.r, line.g, line.b, 0.75 * fade(x * cell, y * cell));
      }
    }
  }
  const grid = new BufferGeometry();
  grid.setAttribute("position", new Float32BufferAttribute(lines, 3));
  grid.setAttribute("color", new Float32BufferAttribute(tints, 4));
  const net = new LineSegments(grid, new LineBasicMaterial({vertexColors: true, transparent: true, depthWrite: false}));
  [lit, net].forEach((mesh, k) => Object.assign(mesh, {renderOrder: -9 + k}));
  floor.add(lit, net);
  floor.cell = cell;
  const gap = 0.004 * extent;
  if (view === "front") {
    floor.rotation.x = Math.PI / 2;
    floor.level = [1, all.max.y + gap];
  } else if (view === "side") {
    floor.rotation.y = Math.PI / 2;
    floor.level = [0, all.min.x - gap];
  } else floor.level = [2, scene.ground === null ? all.min.z - gap : scene.ground];
  root.add(floor);
}

// The light is next to the preset of the camera and points to its target; the ground lies below the target.
function shine(viewer, target, extent, view, back) {
  const {Vector3} = MeshCat.THREE, {sun, floor} = nodeOf(viewer, "mechanism"), [axis, level] = floor.level;
  const leaning = {front: [-0.35, -1, 0.5], side: [1, -0.35, 0.5], top: [-0.3, 0.35, 1], "3d": [-0.25, -0.35, 1]}[view];
  const way = new Vector3(...leaning).add(view === "3d" ? back.clone().multiplyScalar(0.3) : new Vector3()).normalize();
  sun.target.position.copy(target);
  sun.position.copy(target).addScaledVector(way, 3 * extent);
  Object.assign(sun.shadow.camera, {left: -extent, right: extent, top: extent, bottom: -extent, near: 0.1 * extent, far: 8 * extent});
  sun.shadow.camera.updateProjectionMatrix();
  Object.assign(sun.shadow, {normalBias: 0.003 * extent, bias: -0.0004, radius: 2.5});
  const at = target.toArray().map(x => Math.round(x / floor.cell) * floor.cell);
  at[axis] = level;
  floor.position.fromArray(at);
}
