// The scene: meshcat's viewer with the mechanism, its ghosts, traces and arrows in it.
"use strict";

async function unpack(id) {
  const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

// The viewer's own msgpack decoder, without the scene that it usually feeds.
function decode(bytes) {
  let decoded;
  MeshCat.Viewer.prototype.handle_command_bytearray.call(
    {handle_command: command => { decoded = command; }}, new Uint8Array(bytes));
  return decoded;
}

// To merge the parts of a mesh file, meshcat transforms them one after the other; that is the moment to
// note how many triangles of each have which material, which merging forgets, and to drop what only some
// parts have, on which merging fails.
function watchParts(parts) {
  const {BufferGeometry} = MeshCat.THREE, transform = BufferGeometry.prototype.applyMatrix4;
  BufferGeometry.prototype.applyMatrix4 = function (matrix) {
    parts.push(this);
    const common = name => parts.every(part => name in part.attributes);
    for (const part of parts) {
      for (const name of Object.keys(part.attributes)) if (!common(name)) part.deleteAttribute(name);
    }
    return transform.call(this, matrix);
  };
  return () => { BufferGeometry.prototype.applyMatrix4 = transform; };
}

function restoreMaterials(mesh, parts) {
  if (!Array.isArray(mesh.material) || !mesh.material.some(Array.isArray)) return;
  let offset = 0;
  const materials = [];
  mesh.geometry.clearGroups();
  parts.forEach((part, i) => {
    const own = [mesh.material[i]].flat(), count = (part.index || part.attributes.position).count;
    const groups = own.length > 1 ? part.groups : [{start: 0, count, materialIndex: 0}];
    for (const group of groups) {
      mesh.geometry.addGroup(offset + group.start, group.count, materials.length + group.materialIndex);
    }
    materials.push(...own);
    offset += count;
  });
  mesh.material = materials;
}

// A mesh that several bodies share is stored once; the objects hold its number.
function build(viewer, scene) {
  for (const command of scene.objects) {
    const holders = [command.object.object, ...(command.object.geometries || [])];
    for (const holder of holders) if ("mesh" in holder) Object.assign(holder, scene.meshes[holder.mesh]);
    const parts = [], unwatch = watchParts(parts);
    viewer.handle_command(command);
    unwatch();
    const object = nodeOf(viewer, `${command.path}/<object>`);
    restoreMaterials(object, parts);
    // Normals in STL files are often zero, which would be black.
    if (holders.some(holder => holder.format === "stl")) object.geometry.computeVertexNormals();
  }
}

const nodeOf = (viewer, path) => viewer.scene_tree.find(path.split("/").filter(name => name)).object;

// Poses are stored for each frame; between frames places are interpolated linearly, turns on the sphere.
function follower(object, {values}) {
  const {Quaternion} = MeshCat.THREE, next = new Quaternion();
  return at => {
    if (values.length === 7) at = 0;
    const i = Math.min(Math.floor(at), Math.max(0, values.length / 7 - 2)), share = at - i, a = 7 * i;
    const b = share > 0 ? a + 7 : a;
    const part = k => values[a + k] + share * (values[b + k] - values[a + k]);
    object.visible = !Number.isNaN(part(0));
    if (!object.visible) return;
    object.position.set(part(0), part(1), part(2));
    object.quaternion.fromArray(values, a + 3);
    if (share > 0) object.quaternion.slerp(next.fromArray(values, b + 3), share);
  };
}

// A translucent copy of a body in one colour; it shares the body's triangles.
function ghostly(object, colour) {
  const {MeshPhongMaterial} = MeshCat.THREE, copy = object.clone();
  const material = new MeshPhongMaterial({
    color: colour, transparent: true, opacity: 0.45, depthWrite: false,
    polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8,  // where both agree, the body is seen
  });
  copy.traverse(part => { if (part.material) part.material = material; });
  return copy;
}

// A path as small cylinders: all of it faint, what lies behind the cursor full.
function trace({points, colour}, width) {
  const {CylinderGeometry, Group, InstancedMesh, MeshBasicMaterial, Object3D, Vector3} = MeshCat.THREE;
  const n = points.length / 3 - 1, up = new Vector3(0, 1, 0), place = new Object3D(), group = new Group();
  const [all, past] = [0.25, 1].map(opacity => {
    const look = new MeshBasicMaterial({color: colour, opacity, transparent: true, depthTest: false});
    return new InstancedMesh(new CylinderGeometry(width, width, 1, 6, 1, true), look, Math.max(n, 1));
  });
  for (let i = 0; i < n; i++) {
    const from = new Vector3().fromArray(points, 3 * i), step = new Vector3().fromArray(points, 3 * i + 3).sub(from);
    place.position.copy(from).addScaledVector(step, 0.5);
    place.quaternion.setFromUnitVectors(up, step.lengthSq() ? step.clone().normalize() : up);
    place.scale.set(1, step.length() + 0.5 * width, 1);
    place.updateMatrix();
    all.setMatrixAt(i, place.matrix);
    past.setMatrixAt(i, place.matrix);
  }
  group.add(all, past);
  for (const mesh of [all, past]) Object.assign(mesh, {frustumCulled: false, renderOrder: 500});
  return {object: group, follow: at => { past.count = Math.floor(at); }};
}

// A force as an arrow that starts where it acts.
function arrow({points, values, colour}, perNewton, width) {
  const {ConeGeometry, CylinderGeometry, Group, Mesh, MeshBasicMaterial, Vector3} = MeshCat.THREE;
  const look = new MeshBasicMaterial({color: colour, depthTest: false, transparent: true});
  const shaft = new Mesh(new CylinderGeometry(width, width, 1, 12), look);
  const head = new Mesh(new ConeGeometry(3 * width, 9 * width, 16), look);
  const group = new Group().add(shaft, head), up = new Vector3(0, 1, 0);
  shaft.renderOrder = head.renderOrder = 1000;
  const mixed = (array, at) => {
    const i = Math.min(Math.floor(at), Math.max(0, array.length / 3 - 2)), share = at - i;
    const from = new Vector3().fromArray(array, 3 * i);
    return share > 0 ? from.lerp(new Vector3().fromArray(array, 3 * i + 3), share) : from;
  };
  const follow = at => {
    const force = mixed(values, at), length = force.length() * perNewton;
    group.visible = length > 0.1 * width;
    if (!group.visible) return;
    const tip = Math.min(9 * width, 0.6 * length);
    group.position.copy(mixed(points, at));
    group.quaternion.setFromUnitVectors(up, force.normalize());
    shaft.scale.y = length - tip;
    shaft.position.y = (length - tip) / 2;
    head.scale.setScalar(tip / (9 * width));
    head.position.y = length - tip / 2;
  };
  return {object: group, follow};
}

// Puts all that moves into the scene; the function returned brings it to a frame, which need not be whole.
function stage(viewer, scene) {
  const [low, high] = scene.bounds, extent = Math.hypot(...low.map((x, i) => high[i] - x)) || 1;
  const root = nodeOf(viewer, "mechanism"), moves = [];
  for (const pose of scene.poses) moves.push(follower(nodeOf(viewer, pose.path), pose));
  const choices = scene.choices.map(({poses}) => poses.map(pose => follower(nodeOf(viewer, pose.path), pose)));
  for (const ghost of scene.ghosts) {
    for (const pose of ghost.poses) {
      const copy = ghostly(nodeOf(viewer, pose.path), ghost.colour);
      root.add(copy);
      moves.push(follower(copy, pose));
    }
  }
  const perNewton = scene.arrows.largest > 0 ? 0.3 * extent / scene.arrows.largest : 0;
  for (const made of [
    ...scene.traces.map(data => trace(data, 0.0027 * extent)),
    ...scene.arrows.forces.map(data => arrow(data, perNewton, 0.004 * extent)),
  ]) {
    root.add(made.object);
    moves.push(made.follow);
  }
  return (at, choice) => {
    for (const move of [...moves, ...(choices[choice] || [])]) move(at);
    viewer.set_dirty();
  };
}

// Floor, axes and lamps in proportion to the motion.
function furnish(viewer, [low, high]) {
  const centre = low.map((x, i) => (x + high[i]) / 2);
  const extent = Math.hypot(...low.map((x, i) => high[i] - x)) || 1;
  const place = (path, size, [x, y, z]) =>
    viewer.set_transform(path, [size, 0, 0, 0, 0, size, 0, 0, 0, 0, size, 0, x, y, z, 1]);
  const decade = 10 ** Math.floor(Math.log10(extent / 6));
  const cell = decade * ([5, 2].find(k => k * decade <= extent / 6) || 1);
  const cells = 2 * Math.ceil(0.8 * extent / cell);
  const grid = new MeshCat.THREE.GridHelper(cells * cell, cells, 0x9aa3ad, 0xc0c7cf);
  const [x, y] = centre.map(c => Math.round(c / cell) * cell);
  viewer.set_object(["Grid"], grid.rotateX(Math.PI / 2));
  place(["Grid"], 1, [x, y, low[2] - 0.002 * extent]);
  place(["Axes"], 0.2 * extent, [0, 0, 0]);
  for (const name of ["PointLightNegativeX", "PointLightPositiveX"]) {
    place(["Lights", name], extent, centre);
    viewer.set_property(["Lights", name, "<object>"], "distance", 0);
  }
  viewer.set_property(["Lights", "AmbientLight", "<object>"], "intensity", 0.5);
  viewer.set_property(["Lights", "FillLight", "<object>"], "intensity", 0.25);
  viewer.set_property(["Background"], "top_color", [0.98, 0.985, 0.99]);
  viewer.set_property(["Background"], "bottom_color", [0.85, 0.88, 0.91]);
}

// Looks at a flat motion from the side where it is seen best, and steps back until all of it is in sight, below a
// part of the height that the caption covers.
function aim(viewer, [low, high], covered) {
  const {Vector3} = MeshCat.THREE, {camera, controls} = viewer;
  const size = low.map((x, i) => high[i] - x), widest = Math.max(...size) || 1;
  const thin = size.findIndex(s => s === Math.min(...size));
  const flat = [[1, 0.22, 0.2], [0.22, -1, 0.2], [0, -0.3, 1]];
  const [dx, dy, dz] = size[thin] < 0.25 * widest ? flat[thin] : [1, -0.9, 0.55];
  const back = new Vector3(dx, dz, -dy).normalize();  // three.js has y up
  const right = new Vector3(0, 1, 0).cross(back).normalize(), up = back.clone().cross(right);
  camera.fov = 35;
  const whole = Math.tan(camera.fov * Math.PI / 360), tanX = whole * camera.aspect, tanY = whole * (1 - covered);
  const centre = new Vector3((low[0] + high[0]) / 2, (low[2] + high[2]) / 2, -(low[1] + high[1]) / 2);
  let distance = 0.1 * widest;
  for (const [x, y, z] of [0, 1, 2, 3, 4, 5, 6, 7].map(k => size.map((s, i) => (k >> i & 1 ? s : -s) / 2))) {
    const corner = new Vector3(x, z, -y);
    const aside = Math.max(Math.abs(corner.dot(right)) / tanX, Math.abs(corner.dot(up)) / tanY);
    distance = Math.max(distance, corner.dot(back) + 1.12 * aside);
  }
  camera.near = distance / 100;
  camera.far = distance * 100;
  camera.position.copy(centre).addScaledVector(back, distance);
  controls.target.copy(centre);
  controls.update();
}

