
// Assembly in the page: closes the loops of a mechanism by Gauss-Newton when coordinates change. Rows between frames have a wrench w on b and -w on a at the world's origin, dg = w . (V_b - V_a).

const CLOSED = 1e-10, ITERATIONS = 20, LARGEST_STEP = 0.5;  // tolerance of g; iterations per pose; in rad or m, to stay on the branch

function linkage({joints, values, pairs, rows, prescribed}) {
  const {Matrix4} = MeshCat.THREE, n = values.length, pivots = new Set(prescribed);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const subtract = (a, b) => a.map((x, i) => x - b[i]);
  const rotate = ({elements: e}, v) => [0, 1, 2].map(i => e[i] * v[0] + e[4 + i] * v[1] + e[8 + i] * v[2]);
  const transform = (m, v) => rotate(m, v).map((x, i) => x + m.elements[12 + i]);
  const places = joints.map(({place}) => new Matrix4().fromArray(place));
  const above = joints.map(({parent}, j) => { const out = new Set([j + 1]); for (let k = parent; k; k = joints[k - 1].parent) out.add(k); return out; });
  const frames = pairs.map(pair => pair.map(({turn: R, at}) => new Matrix4().set(...R.slice(0, 3), at[0], ...R.slice(3, 6), at[1], ...R.slice(6), at[2], 0, 0, 0, 1)));

  // exp of a twist: Rodrigues' formula, its series near zero.
  const exp = ([x, y, z, ...w]) => {
    const angle = Math.hypot(...w), tiny = angle < 1e-4, square = angle * angle, v = [x, y, z];
    const a = tiny ? 1 - square / 6 : Math.sin(angle) / angle, b = tiny ? 0.5 - square / 24 : (1 - Math.cos(angle)) / square;
    const c = tiny ? 1 / 6 - square / 120 : (1 - a) / square, along = (p, f, g) => {
      const once = cross(w, p), twice = cross(w, once);
      return p.map((e, i) => e + f * once[i] + g * twice[i]);
    };
    const [i, j, k] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(e => along(e, a, b)), t = along(v, b, c);
    return new Matrix4().set(i[0], j[0], k[0], t[0], i[1], j[1], k[1], t[1], i[2], j[2], k[2], t[2], 0, 0, 0, 1);
  };
  const twist = ({axes, at}, x) => [0, 1, 2, 3, 4, 5].map(i => axes.reduce((sum, axis, k) => sum + axis[i] * x[at + k], 0));
  const integrate = ({own, u}, x) => ({
    own: own.map((pose, j) => pose.clone().multiply(exp(twist(joints[j], x)))), u: u.map((value, i) => value + x[i]),
  });
  const world = ({own}) => {
    const out = [new Matrix4()];
    joints.forEach(({parent}, j) => out.push(out[parent].clone().multiply(places[j]).multiply(own[j])));
    return out;
  };

  // Motions (6) of the world's origin for each coordinate.
  const columns = poses => {
    const out = [];
    joints.forEach(({axes, at}, j) => axes.forEach((axis, k) => {
      const pose = poses[j + 1], turn = rotate(pose, axis.slice(3)), shift = rotate(pose, axis.slice(0, 3));
      out[at + k] = {joint: j + 1, linear: cross(pose.elements.slice(12, 15), turn).map((e, i) => e + shift[i]), angular: turn};
    }));
    return out;
  };
  const between = {
    dot_product_1: ({a, b}, A, B) => {
      const [first, second] = [rotate(A, a), rotate(B, b)];
      return [dot(first, second), [0, 0, 0], cross(second, first)];
    },
    dot_product_2: ({a}, A, B) => {
      const n = rotate(A, a), at = transform(B, [0, 0, 0]);
      return [dot(n, subtract(at, transform(A, [0, 0, 0]))), n, cross(at, n)];
    },
    distance: ({length}, A, B) => {
      const at = transform(B, [0, 0, 0]), d = subtract(at, transform(A, [0, 0, 0])), size = Math.hypot(...d), n = d.map(x => x / size);
      return [size - length, n, cross(at, n)];
    },
  };
  const coupled = {
    coordinate: (c, [x, y = 0]) => {
      let p = 0, first = 0;
      for (const factor of [...c].reverse()) [p, first] = [p * y + factor, first * y + p];
      return [x - p, [1, -first]];
    },
    sum: (c, [x, ...more]) => [more.reduce((g, y, k) => g - c[k + 1] * y, x - c[0]), [1, ...c.slice(1).map(factor => -factor)]],
  };

  // g and G of a state.
  const residual = state => {
    const poses = world(state), moving = columns(poses), g = [], G = [];
    for (const row of rows) {
      const entries = new Float64Array(n);
      let value;
      if (row.kind in coupled) {
        const at = row.joints.map(([, , v]) => v), [gap, partials] = coupled[row.kind](row.c, at.map(v => state.u[v]));
        at.forEach((v, k) => { entries[v] += partials[k]; });
        value = row.period ? gap - row.period * Math.round(gap / row.period) : gap;
      } else {
        const [a, b] = pairs[row.pair], [A, B] = [a, b].map(({joint}, k) => poses[joint].clone().multiply(frames[row.pair][k]));
        const [gap, force, torque] = between[row.kind](row, A, B), on = ({joint}, j) => joint > 0 && above[joint - 1].has(j);
        moving.forEach(({joint, linear, angular}, i) => {
          const sign = on(b, joint) - on(a, joint);
          if (sign) entries[i] = sign * (dot(force, linear) + dot(torque, angular));
        });
        value = gap;
      }
      g.push(value);
      G.push(entries);
    }
    return {g, G};
  };

  // The minimum-norm x with G x = -g in the free coordinates; rows may be redundant.
  const minimumNormStep = (G, g) => {
    const m = g.length, H = G.map(a => G.map(b => a.reduce((sum, x, i) => sum + (pivots.has(i) ? 0 : x * b[i]), 0)));
    const slack = 1e-12 * Math.max(...H.map((row, i) => row[i]), 1e-300), L = H.map(() => new Float64Array(m)), y = g.map(x => -x);
    for (let i = 0; i < m; i++) {
      for (let j = 0; j <= i; j++) {
        let sum = H[i][j] + (i === j ? slack : 0);
        for (let k = 0; k < j; k++) sum -= L[i][k] * L[j][k];
        L[i][j] = i === j ? Math.sqrt(Math.max(sum, slack)) : sum / L[j][j];
      }
    }
    for (let i = 0; i < m; i++) {
      for (let k = 0; k < i; k++) y[i] -= L[i][k] * y[k];
      y[i] /= L[i][i];
    }
    for (let i = m - 1; i >= 0; i--) {
      for (let k = i + 1; k < m; k++) y[i] -= L[k][i] * y[k];
      y[i] /= L[i][i];
    }
    return Float64Array.from({length: n}, (_, i) => (pivots.has(i) ? 0 : G.reduce((sum, row, k) => sum + row[i] * y[k], 0)));
  };

  // A closed state close to another one, with prescribed coordinates; null if none is found.
  const close = (state, targets) => {
    for (let k = 0; k < ITERATIONS; k++) {
      const {g, G} = residual(state), x = new Float64Array(n);
      prescribed.forEach((c, i) => { x[c] = targets[i] - state.u[c]; });
      const left = g.map((value, r) => prescribed.reduce((sum, c) => sum + G[r][c] * x[c], value));
      if (Math.max(0, ...g.map(Math.abs), ...prescribed.map(c => Math.abs(x[c]))) < CLOSED) return state;
      if (rows.length) minimumNormStep(G, left).forEach((step, i) => { x[i] += step; });
      if (!(Math.max(...x.map(Math.abs)) < LARGEST_STEP)) return null;
      state = integrate(state, x);
    }
    return null;
  };
  const start = {own: joints.map(({pose}) => new Matrix4().fromArray(pose)), u: Float64Array.from(values)};
  return {start, close, integrate, world, open: state => Math.max(0, ...residual(state).g.map(Math.abs))};
}

// Place the parts of the scene on their joints.
function placeParts(viewer, {parts}, poses) {
  const {Matrix4, Vector3} = MeshCat.THREE, size = new Vector3(), z = new Vector3(0, 0, 1);
  for (const {path, on, kind, length} of parts) {
    const object = nodeOf(viewer, path);
    const [first, second] = on.map(({joint, place}) => poses[joint].clone().multiply(new Matrix4().fromArray(place)));
    first.decompose(object.position, object.quaternion, size);
    if (!second) continue;
    const direction = new Vector3().setFromMatrixPosition(second).sub(object.position), to = direction.length();
    object.quaternion.setFromUnitVectors(z, direction.normalize());
    if (kind === "coil") {
      nodeOf(viewer, `${path}/<object>`).morphTargetInfluences[0] = to / length - 1;
      continue;
    }
    const body = Math.min(0.5 * length, 0.8 * to);
    const [low, high] = {rod: [0.9 * body, to], tube: [0, body], link: [0, length]}[kind];
    object.position.addScaledVector(direction, (low + high) / 2);
    if (kind !== "link") object.scale.z = high - low;
  }
  viewer.set_dirty();
}
