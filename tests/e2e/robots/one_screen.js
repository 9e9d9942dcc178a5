// Run in a robot's page over a background. Returns the faults: cells or sticks that are not wholly on the
// screen, and parts to press that are too near to STOP.
() => {
  const SLACK = 1;
  const LEAST_FREE = 16; // pixels around STOP
  const boxOf = (el) => el.getBoundingClientRect();
  const isShown = (el) => el.checkVisibility() && boxOf(el).width > 0;
  const shown = (selector) => [...document.querySelectorAll(selector)].filter(isShown);
  const name = (el) => {
    const cell = el.closest("[data-config]");
    return cell ? JSON.parse(cell.dataset.config).slot : el.dataset.verb || el.className;
  };
  const faults = [];
  if (!document.querySelector('[data-place="ground"]')) return faults;
  const stage = document.querySelector("[data-stage]");
  const dock = document.querySelector(".urc-controls");
  // On a phone in portrait, the dock covers whatever is below its edge.
  const isUpright = matchMedia("(width < 37.5rem)").matches;
  const foot = isUpright && dock ? boxOf(dock).top : innerHeight;
  if (stage.scrollHeight > stage.clientHeight + SLACK) faults.push(`the page scrolls by ${stage.scrollHeight - stage.clientHeight} px`);
  const cells = shown('.urc-cell:not([data-place="ground"])');
  const sticks = shown(".joystick-face, .axis, .dpad, .hold-button");
  for (const el of [...cells, ...sticks]) {
    const { left, top, right, bottom } = boxOf(el);
    const out = Math.max(bottom - foot, boxOf(stage).top - top, -left, right - innerWidth);
    if (out > SLACK) faults.push(`${name(el)} is ${Math.round(out)} px out of the screen`);
  }
  for (const face of sticks) {
    const { left, top, right, bottom } = boxOf(face);
    const [x, y] = [(left + right) / 2, (top + bottom) / 2];
    for (const [across, down] of [[x, y], [x, top + 4], [x, bottom - 4], [left + 4, y], [right - 4, y]]) {
      const met = document.elementFromPoint(across, down)?.closest(".urc-cell, .urc-controls, .urc-drawer-handle");
      if (met !== face.closest(".urc-cell")) faults.push(`${met?.className} is over ${name(face)}`);
    }
  }
  const stop = document.querySelector(".urc-stop-button");
  const parts = shown(".urc-cell:not([data-place='ground']), .urc-take, .urc-verbs > *, .urc-latched > .urc-button, .urc-drawer-handle, [data-place='ground'] button");
  for (const el of stop ? parts : []) {
    const [a, b] = [boxOf(stop), boxOf(el)];
    const across = Math.max(a.left - b.right, b.left - a.right, 0);
    const down = Math.max(a.top - b.bottom, b.top - a.bottom, 0);
    const free = Math.hypot(across, down);
    if (free < LEAST_FREE - SLACK) faults.push(`${name(el)} is ${Math.round(free)} px from STOP`);
  }
  return faults;
}
