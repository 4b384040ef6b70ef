
// Poses instead of a motion: each free coordinate has a slider over all closed poses with the remaining ones at their
// start; if several differ from their start, the page closes the loops.

function sliders(page, scene) {
  const box = byId("plots"), main = document.querySelector("main"), wraps = [], linked = scene.linkage && linkage(scene.linkage);
  main.classList.add("still");
  main.classList.toggle("bare", scene.sliders.length === 0);
  const make = (tag, className, text = "") => Object.assign(document.createElement(tag), {className, textContent: text});
  scene.sliders.forEach((slider, k) => {
    const {joint, share, dead, description} = slider, wrap = make("div", "slider"), input = make("input", "");
    const head = make("div", "head"), value = make("output", ""), track = make("div", "track"), note = make("div", "note", description);
    Object.assign(input, {type: "range", min: 0, max: 1, step: "any", value: share, ariaLabel: joint});
    head.append(make("b", "", joint), value);
    track.append(input);
    for (const at of dead) {
      const mark = make("i", "dead");
      mark.style.left = `calc(8px + ${at} * (100% - 16px))`;
      mark.title = "dead point";
      track.append(mark);
    }
    wrap.append(head, track, note);
    box.append(wrap);
    input.oninput = () => page.slide(k);
    wraps.push({...slider, wrap, input, value, note, at: share});
  });
  if (wraps.length > 1) {
    const back = make("button", "back", "reset all");
    back.onclick = () => page.slide(0, true);
    box.append(back);
  }
  box.append(make("p", "note", scene.note));

  const valueOf = ({u, at}) => {
    const place = at * (u.length - 1), i = Math.min(Math.floor(place), u.length - 2), part = place - i;
    return u[i] + part * (u[i + 1] - u[i]);
  };
  const show = (k, over) => {
    wraps.forEach(({input, at, value, unit, scale, wrap, note, description, ...slider}, j) => {
      if (Number(input.value) !== at) input.value = at;
      value.textContent = `${number(scale * valueOf({at, ...slider}))} ${unit}`;
      note.textContent = j === k && over || description;
      wrap.classList.toggle("over", j === k && Boolean(over));
    });
    page.said = `${wraps[k].joint} = ${wraps[k].value.textContent}${over ? `, ${over}` : ""}`;
  };

  // If one coordinate differs from its start, its pose is stored; if several do, the current pose is continued in small steps.
  let state = null, alone = 0;
  const along = (k, to) => {
    const {curves, values} = scene.linkage, n = values.length, one = wraps[alone], all = () => wraps.map(valueOf);
    if (!state) {
      const nearest = Math.round(one.at * (one.u.length - 1));
      state = linked.close(linked.integrate(linked.start, curves[alone].slice(n * nearest, n * (nearest + 1))), all());
    }
    const moved = wraps[k], from = moved.at;
    let done = 0, part = Math.min(1, 0.5 / (moved.u.length - 1) / Math.max(1e-12, Math.abs(to - from)));
    while (state && done < 1 && part > 1e-4 * Math.min(1, 1 / Math.abs(to - from))) {
      const next = Math.min(1, done + part), before = moved.at;
      moved.at = from + next * (to - from);
      const found = linked.close(state, all());
      if (found) [state, done] = [found, next];
      else [moved.at, part] = [before, part / 2];
    }
    const beyond = state && scene.linkage.limits.find(({at, low, high}) => state.u[at] < low - 1e-6 || state.u[at] > high + 1e-6);
    return done < 1 ? "the loops cannot be closed any further" : beyond ? `beyond the limits of ${beyond.joint}` : "";
  };
  page.slide = (k, back = false) => {
    if (!wraps.length) return;
    const to = Number(wraps[k].input.value);
    if (back) for (const wrap of wraps) wrap.at = wrap.share;
    if (linked && !back && wraps.some(({at, share}, j) => j !== k && at !== share)) {
      show(k, along(k, to));
      if (state) placeParts(page.viewer, scene.linkage, linked.world(state));
      page.open = state ? linked.open(state) : NaN;
      page.show();
      return;
    }
    for (const wrap of wraps) wrap.at = wrap.share;
    if (!back) wraps[k].at = to;
    [state, alone, page.choice] = [null, k, k];
    const over = wraps[k].beyond[Math.round(wraps[k].at * (wraps[k].u.length - 1))];
    show(k, over ? `beyond the limits of ${over}` : "");
    page.jump(page.start + wraps[k].at * page.duration);
  };
}
