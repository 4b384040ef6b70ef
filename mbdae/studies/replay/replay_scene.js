// The scene: commands and animations of meshcat's viewer.
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

// Geometries that several parts share are stored once, packed.
function build(viewer, {geometries, commands}) {
  for (const {low, span, data: {attributes: {position}, index}} of geometries) {
    position.type = "Float32Array";
    position.array = Float32Array.from(position.array, (x, i) => low[i % 3] + x * span[i % 3] / 65535);
    for (let i = 1; i < index.array.length; i++) index.array[i] += index.array[i - 1];
  }
  for (const command of commands) {
    for (const geometry of command.object?.geometries || []) {
      if ("shared" in geometry) geometry.data = geometries[geometry.shared].data;
    }
    viewer.handle_command(command);
  }
}

// Without WebGL the viewer has a context without effect.
function withoutDrawing() {
  const canvas = HTMLCanvasElement.prototype, getContext = canvas.getContext, box = [0, 0, 1, 1];
  if (["webgl2", "webgl"].some(kind => getContext.call(document.createElement("canvas"), kind))) return () => {};
  const values = {7938: "WebGL 2.0", 35724: "WebGL GLSL ES 3.00", 2978: box, 3088: box};
  canvas.getContext = () => new Proxy({}, {get: (_, name) => name === "getParameter" ? at => values[at] ?? 16 : () => ({})});
  return viewer => {
    canvas.getContext = getContext;
    viewer.renderer.render = () => {};
    byId("caption").append("This browser has no WebGL: the scene is not drawn.");
  };
}

const nodeOf = (viewer, path) => viewer.scene_tree.find(path.split("/").filter(name => name)).object;

// Move the scene to a time, of the motion or of a choice; the viewer's animator interpolates between frames.
function stage(viewer, scene) {
  let loaded;
  const load = chosen => {
    const sets = [scene, ...(chosen ? [chosen] : [])], clips = sets.flatMap(({animations, times}) => animations.map(({path, clip}) => ({
      path: path.split("/").filter(name => name), clip: {...clip, tracks: clip.tracks.map(track => ({times, ...track}))},
    })));
    const replaced = new Map(clips.map(animation => [animation.path.join("/"), animation]));
    viewer.set_animation([...replaced.values()], {play: true});
    viewer.animator.pause();
  };
  return (t, choice, again) => {
    if (again || choice !== loaded) load(scene.choices[loaded = choice]);
    viewer.animator.seek(t);
  };
}

// Closures are marked if their gap is visible, or on request.
function marks(viewer, {gaps, extent}) {
  const wide = gaps.filter(({open}) => open > 0.004 * extent);
  return all => {
    const shown = all ? gaps : wide;
    for (const gap of gaps) {
      for (const path of gap.paths) viewer.handle_command({type: "set_property", path: `${path}/<object>`, property: "visible", value: shown.includes(gap)});
    }
    return shown.map(({name, open}) => (open === null ? name : `${name} open by up to ${open.toPrecision(2)} m`));
  };
}
