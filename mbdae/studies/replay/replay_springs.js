
// Coils and tubes between two moving points, stretched to their distance.

const mixed = (array, width, first, at) => {
  const {Vector3} = MeshCat.THREE, frames = array.length / width;
  const i = Math.min(Math.floor(at), Math.max(0, frames - 2)), share = frames > 1 ? at - i : 0;
  const from = new Vector3().fromArray(array, width * (frames > 1 ? i : 0) + first);
  return share > 0 ? from.lerp(new Vector3().fromArray(array, width * (i + 1) + first), share) : from;
};

// A wire wound about z; the parts of its points that depend on the length are stored separately.
function coil(radius, wire, length) {
  const {BufferAttribute, BufferGeometry} = MeshCat.THREE, around = 10;
  const turns = Math.max(6, Math.min(16, Math.round(length / (1.9 * radius)))), along = 24 * turns;
  const points = [], normals = [], shares = [], index = [];
  for (let i = 0; i <= along; i++) {
    const s = i / along, winding = (s - 0.08) / 0.84, inside = winding > 0 && winding < 1;
    const angle = 2 * Math.PI * turns * Math.min(1, Math.max(0, winding)), c = Math.cos(angle), d = Math.sin(angle);
    const r = radius * Math.min(1, Math.max(0, Math.min(winding, 1 - winding) * turns * 2));
    const rise = inside ? length * 0.84 / (2 * Math.PI * turns * Math.hypot(r, length / (2 * Math.PI * turns))) : 1;
    const turn = Math.sqrt(Math.max(0, 1 - rise * rise));
    const side = [d * rise, -c * rise, turn];  // of the wire, normal to (c, d, 0), which points outwards
    for (let k = 0; k < around; k++) {
      const u = Math.cos(2 * Math.PI * k / around), v = Math.sin(2 * Math.PI * k / around);
      const normal = [u * c + v * side[0], u * d + v * side[1], v * side[2]];
      points.push(r * c + wire * normal[0], r * d + wire * normal[1], wire * normal[2]);
      normals.push(...normal);
      shares.push(s);
      if (i === along) continue;
      const [a, b] = [around * i + k, around * i + (k + 1) % around];
      index.push(a, b, a + around, b, b + around, a + around);
    }
  }
  const geometry = new BufferGeometry(), place = new Float32Array(points);
  geometry.setAttribute("position", new BufferAttribute(place, 3));
  geometry.setAttribute("normal", new BufferAttribute(new Float32Array(normals), 3));
  geometry.setIndex(index);
  const stretch = to => {
    shares.forEach((share, i) => { place[3 * i + 2] = points[3 * i + 2] + share * to; });
    geometry.attributes.position.needsUpdate = true;
  };
  return {geometry, stretch};
}

// A spring, a damper or both; ends (x, y, z of both, for each frame).
function spring({coil: wound, tube, length, ends: own}, width, look) {
  const {CylinderGeometry, Group, Mesh, Vector3} = MeshCat.THREE, group = new Group(), z = new Vector3(0, 0, 1);
  const radius = Math.min(2.4 * width, 0.1 * length), parts = [];
  const add = (geometry, colour) => {
    const mesh = new Mesh(geometry, look || paint(colour));
    Object.assign(mesh, {castShadow: !look, receiveShadow: !look, frustumCulled: false});
    group.add(mesh);
    return mesh;
  };
  if (wound) {
    const {geometry, stretch} = coil(radius, Math.min(0.5 * width, 0.22 * radius), length);
    add(geometry, [0.8, 0.22, 0.2, 1]);
    parts.push(stretch);
  }
  if (tube) {
    const thick = wound ? 0.5 * radius : 0.8 * radius;
    const [outer, rod] = [[thick, 0.33], [0.5 * thick, 0.62]].map(([r, grey]) => {
      const turned = new CylinderGeometry(r, r, 1, 24).rotateX(Math.PI / 2).translate(0, 0, 0.5);
      return add(turned, [grey, grey, grey + 0.03, 1]);
    });
    parts.push(to => {
      const body = Math.max(Math.min(0.5 * length, 0.8 * to), 1e-9);
      outer.scale.z = body;
      rod.position.z = 0.9 * body;
      rod.scale.z = Math.max(to - 0.9 * body, 1e-9);
    });
  }
  let known = NaN;
  const follow = (at, ends = own) => {
    const a = mixed(ends, 6, 0, at), d = mixed(ends, 6, 3, at).sub(a), to = d.length();
    group.visible = !Number.isNaN(to);
    if (!group.visible) return;
    group.position.copy(a);
    if (to > 0) group.quaternion.setFromUnitVectors(z, d.divideScalar(to));
    if (to !== known) for (const part of parts) part(to);
    known = to;
  };
  return {object: group, follow};
}
