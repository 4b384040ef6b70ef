// Script of a live view in meshcat's page: shows the state of the simulation, and pulls bodies with the pointer.
"use strict";

const live = (() => {
  const socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/live`);
  const send = message => { if (socket.readyState === 1) socket.send(JSON.stringify(message)); };
  const state = document.body.appendChild(document.createElement("div")), page = {send, frames: 0, state: {}};
  state.style.cssText = "position: absolute; left: 16px; top: 12px; right: 340px; font: 14px system-ui, sans-serif; color: #24292f; white-space: pre-line; pointer-events: none";
  const showText = (text, failed) => {
    state.textContent = text;
    state.style.color = failed ? "#a40e26" : "#24292f";
  };
  socket.onmessage = ({data}) => {
    page.state = JSON.parse(data);
    if (page.state.camera && !page.frames) aimCamera(page.state.camera);
    showText(page.state.text, page.state.wrong);
    if (page.state.coarse && !page.coarse) drawCoarsely();
    requestAnimationFrame(() => {  // the viewer has drawn it by the next frame
      page.frames++;
      send({frame: page.state.frame});
    });
  };
  socket.onclose = () => showText(`${page.state.text || ""}\nThe live view has ended.`, true);
  viewer.gui.open();
  viewer.gui.__folders.Scene.close();
  viewer.gui.width = 320;

  // A drag that begins on a body pulls it towards the pointer, in the plane through the point that faces the camera.
  const {Plane, Raycaster, Vector2, Vector3} = MeshCat.THREE, caster = new Raycaster(), plane = new Plane();
  const canvas = viewer.renderer.domElement;
  const aim = ({clientX, clientY}) => {
    const {left, top, width, height} = canvas.getBoundingClientRect();
    caster.setFromCamera(new Vector2(2 * (clientX - left) / width - 1, 1 - 2 * (clientY - top) / height), viewer.camera);
  };
  const local = point => viewer.scene.worldToLocal(point.clone()).toArray();
  const nameOf = object => {
    const names = [];
    for (let x = object; x && x !== viewer.scene; x = x.parent) if (x.name && x.name !== "<object>") names.unshift(x.name);
    return names.slice(1).join("/");
  };
  let pulling = false;
  canvas.addEventListener("pointerdown", event => {
    aim(event);
    viewer.scene.updateMatrixWorld();
    const bodies = viewer.scene_tree.find(["mechanism"]).object;
    const hit = caster.intersectObject(bodies, true).find(({object}) => nameOf(object) !== "pull");  // hidden, or a line
    if (event.button || !hit) return;
    pulling = true;
    viewer.controls.enabled = false;
    plane.setFromNormalAndCoplanarPoint(viewer.camera.getWorldDirection(new Vector3()), hit.point);
    send({pull: nameOf(hit.object), point: local(hit.point)});
    canvas.setPointerCapture(event.pointerId);
  }, true);
  canvas.addEventListener("pointermove", event => {
    if (!pulling) return;
    aim(event);
    const to = caster.ray.intersectPlane(plane, new Vector3());
    if (to) send({to: local(to)});
  }, true);
  const drop = () => {
    if (!pulling) return;
    pulling = false;
    viewer.controls.enabled = true;
    send({drop: true});
  };
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, drop, true);

  // A browser without a graphics card draws a quarter of the pixels.
  function drawCoarsely() {
    page.coarse = true;
    viewer.renderer.setPixelRatio(0.5 * Math.min(window.devicePixelRatio, 1));
    viewer.set_dirty();
  }

  // The camera looks at the mechanism; z of the mechanism is up.
  function aimCamera({position, target}) {
    viewer.camera.position.set(position[0], position[2], -position[1]);
    viewer.controls.target.set(target[0], target[2], -target[1]);
    viewer.controls.update();
    viewer.set_dirty();
  }
  return page;
})();
