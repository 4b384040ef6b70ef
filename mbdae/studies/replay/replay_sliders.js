
// Poses instead of a motion: one slider for each free coordinate, along all poses in which the loops stay closed.

function sliders(page, scene) {
  const box = byId("plots"), main = document.querySelector("main"), wraps = [];
  main.classList.add("still");
  main.classList.toggle("bare", scene.sliders.length === 0);
  const make = (tag, className, text = "") => Object.assign(document.createElement(tag), {className, textContent: text});
  scene.sliders.forEach((slider, k) => {
    const {joint, unit, u, share, dead, says, beyond} = slider, wrap = make("div", "slider"), input = make("input", "");
    const head = make("div", "head"), value = make("output", ""), track = make("div", "track"), note = make("div", "note", says);
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
    const show = moved => {
      const at = input.value * (u.length - 1), i = Math.min(Math.floor(at), u.length - 2), part = at - i;
      value.textContent = `${number(u[i] + part * (u[i + 1] - u[i]))} ${unit}`;
      const over = beyond[Math.round(at)];
      note.textContent = over ? `beyond the limits of ${over}` : says;
      wrap.classList.toggle("over", Boolean(over));
      if (moved) page.said = `${joint} = ${value.textContent}${over ? `, beyond the limits of ${over}` : ""}`;
    };
    input.oninput = () => page.slide(k);
    wraps.push({input, show, share});
  });
  box.append(make("p", "note", scene.note));
  // One coordinate moves; the others go back to where they start.
  page.slide = k => {
    wraps.forEach(({input, share, show}, j) => {
      if (j !== k) input.value = share;
      show(j === k);
    });
    if (!wraps.length) return;
    page.choice = k;
    page.jump(page.start + Number(wraps[k].input.value) * page.duration);
  };
}
