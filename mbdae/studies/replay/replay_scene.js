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

// Without WebGL the scene is not drawn; its tree and motions, plots and numbers remain: the viewer has a context without effect.
function withoutDrawing(pane) {
  const made = HTMLCanvasElement.prototype.getContext;
  if (["webgl2", "webgl"].some(kind => made.call(document.createElement("canvas"), kind))) return () => {};
  const texts = {7938: "WebGL 2.0", 35724: "WebGL GLSL ES 3.00", 2978: [0, 0, 1, 1], 3088: [0, 0, 1, 1]};  // version, language, viewport, scissor box
  const answers = {
    getParameter: number => texts[number] ?? 16, getShaderPrecisionFormat: () => ({precision: 23, rangeMin: 127, rangeMax: 127}),
    getContextAttributes: () => ({alpha: true}), getSupportedExtensions: () => [], getExtension: () => null, isContextLost: () => false,
  };
  const context = new Proxy(answers, {get: (known, name) => known[name] ?? (() => ({}))});
  HTMLCanvasElement.prototype.getContext = function (kind, ...more) { return /webgl/.test(kind) ? context : made.call(this, kind, ...more); };
  return viewer => {
    HTMLCanvasElement.prototype.getContext = made;
    viewer.renderer.render = () => {};
    pane.append(Object.assign(document.createElement("p"), {id: "undrawn", textContent: "This browser has no WebGL: the scene is not drawn."}));
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
