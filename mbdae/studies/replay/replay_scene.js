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

// Before meshcat merges the parts of a mesh file, it transforms them one by one. This hook records the triangles of
// each material, which merging loses, and removes attributes that not all parts have, on which merging fails.
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

// Triangles as they are stored: points in 65535ths of their box, corners as differences to the corner before.
function triangles({low, high, points, corners, parts}) {
  const {BufferAttribute, BufferGeometry} = MeshCat.THREE, n = corners.length;
  const flat = new Float32Array(3 * n), index = new Uint32Array(n), geometry = new BufferGeometry();
  for (let i = 0, at = 0; i < n; i++) {
    index[i] = at += corners[i];
    for (let k = 0; k < 3; k++) flat[3 * i + k] = low[k] + points[3 * at + k] * (high[k] - low[k]) / 65535;
  }
  geometry.setAttribute("position", new BufferAttribute(flat, 3));
  geometry.setAttribute("normal", new BufferAttribute(creased(flat, index, points.length / 3, Math.cos(0.6)), 3));
  parts.forEach(({start, count}, i) => geometry.addGroup(start, count, i));
  return geometry;
}

// A normal for each corner: the mean over the adjacent triangles within the edge angle.
function creased(flat, index, count, edge) {
  const n = index.length, faces = new Float32Array(n), areas = new Float32Array(n / 3), out = new Float32Array(3 * n);
  for (let f = 0; f < n; f += 3) {
    const at = 3 * f, edges = [3, 4, 5, 6, 7, 8].map(k => flat[at + k] - flat[at + k % 3]);
    const [ux, uy, uz, vx, vy, vz] = edges, normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const size = areas[f / 3] = Math.hypot(...normal);
    if (size > 0) for (let k = 0; k < 3; k++) faces[f + k] = normal[k] / size;
  }
  const from = new Uint32Array(count + 1), around = new Uint32Array(n);  // the corners at each point
  for (const point of index) from[point + 1]++;
  for (let p = 0; p < count; p++) from[p + 1] += from[p];
  const next = from.slice();
  index.forEach((point, c) => { around[next[point]++] = c; });
  for (let c = 0; c < n; c++) {
    const own = c - c % 3, x = faces[own], y = faces[own + 1], z = faces[own + 2];
    let a = 0, b = 0, d = 0;
    for (let k = from[index[c]]; k < from[index[c] + 1]; k++) {
      const f = around[k] - around[k] % 3, weight = areas[f / 3];
      if (faces[f] * x + faces[f + 1] * y + faces[f + 2] * z < edge) continue;
      a += weight * faces[f];
      b += weight * faces[f + 1];
      d += weight * faces[f + 2];
    }
    const size = Math.hypot(a, b, d);
    out.set(size > 0 ? [a / size, b / size, d / size] : [x, y, z], 3 * c);
  }
  return out;
}

const paint = ([r, g, b, a]) => new MeshCat.THREE.MeshPhongMaterial({
  color: new MeshCat.THREE.Color(r, g, b), opacity: a, transparent: a < 1, shininess: 40, specular: 0x1c1c1c, side: 2,
});

// A mesh that several bodies share is stored once; the objects have its index.
function build(viewer, scene) {
  const geometries = scene.meshes.map(mesh => "points" in mesh ? triangles(mesh) : null);
  scene.objects.forEach((command, k) => {
    const holders = [command.object.object, ...(command.object.geometries || [])];
    const number = holders.map(holder => holder.mesh).find(mesh => mesh !== undefined), geometry = geometries[number];
    if (geometry) {
      const {parts} = scene.meshes[number], own = command.object.object.rgba;
      const mesh = new MeshCat.THREE.Mesh(geometry, parts.map(({rgba}) => paint(own || rgba || [0.7, 0.7, 0.7, 1])));
      mesh.applyMatrix4(new MeshCat.THREE.Matrix4().fromArray(command.object.object.matrix));
      viewer.set_object(command.path.split("/").filter(name => name), mesh);
    } else {
      for (const holder of holders) if ("mesh" in holder) Object.assign(holder, scene.meshes[holder.mesh]);
      const parts = [], unwatch = watchParts(parts);
      viewer.handle_command(command);
      unwatch();
      restoreMaterials(nodeOf(viewer, `${command.path}/<object>`), parts);
    }
    setShadows(nodeOf(viewer, command.path), command.path.includes("/closure/"), k);
  });
}

// Solid shapes cast and receive shadows; of coplanar faces that of the later shape is visible.
function setShadows(object, mark, k) {
  object.traverse(part => {
    if (!part.isMesh) return;
    part.castShadow = part.receiveShadow = !mark;
    for (const look of [part.material].flat()) {
      if (!mark) Object.assign(look, {polygonOffset: true, polygonOffsetFactor: 0, polygonOffsetUnits: -4 * (k % 12)});
    }
  });
}

const nodeOf = (viewer, path) => viewer.scene_tree.find(path.split("/").filter(name => name)).object;

// Poses are stored for each frame; between frames positions are interpolated linearly, rotations by slerp.
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

const translucent = colour => new MeshCat.THREE.MeshPhongMaterial({
  color: colour, transparent: true, opacity: 0.45, depthWrite: false,
  polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8,  // where both coincide, the body is visible
});

// A translucent copy of a body in one colour; it shares the body's triangles.
function ghostly(object, colour) {
  const copy = object.clone(), look = translucent(colour);
  copy.traverse(part => {
    if (part.material) part.material = Array.isArray(part.material) ? part.material.map(() => look) : look;
    part.castShadow = part.receiveShadow = false;
  });
  return copy;
}

// A path as small cylinders: faint as a whole, opaque up to the current time.
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
  const follow = at => {
    const force = mixed(values, 3, 0, at), length = force.length() * perNewton;
    group.visible = length > 0.1 * width;
    if (!group.visible) return;
    const tip = Math.min(9 * width, 0.6 * length);
    group.position.copy(mixed(points, 3, 0, at));
    group.quaternion.setFromUnitVectors(up, force.normalize());
    shaft.scale.y = length - tip;
    shaft.position.y = (length - tip) / 2;
    head.scale.setScalar(tip / (9 * width));
    head.position.y = length - tip / 2;
  };
  return {object: group, follow};
}

// A ball at a sticking joint or closed contact while it is active, and a growing, fading one at impacts.
function switched(points, {active, impacts, strength}, colours, radius, timeOf, flash) {
  const {Group, Mesh, MeshBasicMaterial, SphereGeometry} = MeshCat.THREE, group = new Group();
  const [ball, burst] = [colours.active, colours.impacts].map((color, k) => {
    const look = new MeshBasicMaterial({color, depthTest: false, transparent: true, opacity: 0.6});
    const mesh = new Mesh(new SphereGeometry(radius, 32, 16), look);
    mesh.renderOrder = 800 + k;
    group.add(mesh);
    return mesh;
  });
  const follow = at => {
    const t = timeOf(at), last = impacts.findLastIndex(when => when <= t), age = last < 0 ? 1 : (t - impacts[last]) / flash;
    group.position.copy(mixed(points, 3, 0, at));
    ball.visible = active.some((begin, i) => i % 2 === 0 && begin <= t && t <= active[i + 1]);
    burst.visible = age < 1;
    burst.scale.setScalar(strength[last] * (1.5 + 2 * age) || 1e-3);
    burst.material.opacity = 0.85 * (1 - age);
  };
  return {object: group, follow};
}

// Adds all moving objects to the scene; the returned function moves them to a frame, which may be fractional.
function stage(viewer, scene, extent) {
  const root = nodeOf(viewer, "mechanism"), moves = [], put = made => {
    root.add(made.object);
    moves.push(made.follow);
  };
  for (const pose of scene.poses) moves.push(follower(nodeOf(viewer, pose.path), pose));
  const wound = scene.springs.map(data => spring(data, scene.width));
  wound.forEach(put);
  const choices = scene.choices.map(({poses, springs = []}) => [
    ...poses.map(pose => follower(nodeOf(viewer, pose.path), pose)),
    ...springs.map(({ends}, k) => at => wound[k].follow(at, ends)),
  ]);
  for (const {poses, springs, colour} of scene.ghosts) {
    for (const pose of poses) {
      const copy = ghostly(nodeOf(viewer, pose.path), colour);
      put({object: copy, follow: follower(copy, pose)});
    }
    for (const data of springs) put(spring(data, scene.width, translucent(colour)));
  }
  const perNewton = scene.arrows.largest > 0 ? 0.3 * extent / scene.arrows.largest : 0;
  for (const data of scene.traces) put(trace(data, 0.0027 * extent));
  for (const data of scene.arrows.forces) put(arrow(data, perNewton, 0.004 * extent));
  const timeOf = at => scene.start + (scene.end - scene.start) * at / Math.max(1, scene.frames - 1);
  const radius = 3 * scene.width, flash = 0.25 * scene.speed;
  for (const data of scene.switched.each) {
    for (const points of data.positions) put(switched(points, data, scene.switched, radius, timeOf, flash));
  }
  const place = (at, choice) => {
    for (const move of [...moves, ...(choices[choice] || [])]) move(at);
    viewer.set_dirty();
  };
  return {place, wound};
}

// Closures are marked if their gap is visible, or on request.
function marks(viewer, scene, extent) {
  const node = nodeOf(viewer, "mechanism/closure"), balls = [...node.children], names = scene.gaps.map(({name}) => name);
  const wide = scene.gaps.filter(({open}) => open > 0.004 * extent).map(({name}) => name);
  const words = {};
  for (const {name, open} of scene.gaps) words[name] = open === null ? name : `${name} open by up to ${open.toPrecision(2)} m`;
  const show = all => {
    const shown = all ? names : wide;
    for (const ball of balls) ball.children.forEach(part => { part.visible = shown.includes(ball.name.slice(0, -2)); });
    viewer.set_dirty();
    return shown.map(name => words[name]);
  };
  return {show};
}
