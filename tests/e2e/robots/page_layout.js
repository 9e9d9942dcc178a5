// Run in a robot's page. Returns the shares of the screen in percent, and the faults of the layout: cells
// or buttons on top of each other, cells out of the stage, and sticks of different sizes or places.
() => {
  const STEP = Math.sqrt((innerWidth * innerHeight) / 12_000); // pixels between two samples
  const SLACK = 1.5;
  const boxOf = (el) => el.getBoundingClientRect();
  const isShown = (el) => el.checkVisibility() && boxOf(el).width > 0;
  const stage = document.querySelector("[data-stage]");
  const room = boxOf(stage);
  // An alarm is a band below the bar, for as long as it lasts.
  const bands = document.querySelector(".urc-bands");
  const band = bands ? boxOf(bands) : new DOMRect();
  const picture = document.querySelector('[data-place="ground"]');
  const view = picture ? boxOf(picture) : new DOMRect();
  // The bars next to a camera's image are no picture.
  const canvas = picture?.querySelector(".camera-picture");
  const shown = canvas && boxOf(canvas).width > 0 ? boxOf(canvas) : view;
  const isIn = (box, x, y) => x >= box.left && x < box.right && y >= box.top && y < box.bottom;
  let [ground, image, inside, bars, seen] = [0, 0, 0, 0, 0];
  for (let y = STEP / 2; y < innerHeight; y += STEP) {
    if (y >= band.top && y < band.bottom) continue;
    for (let x = STEP / 2; x < innerWidth; x += STEP) {
      if (y < room.top || y >= room.bottom) {
        bars += 1;
        continue;
      }
      inside += 1;
      seen += Number(isIn(view, x, y) && isIn(shown, x, y));
      const isFree = Boolean(document.elementFromPoint(x, y)?.closest('[data-place="ground"]'));
      ground += Number(isFree);
      image += Number(isFree && isIn(shown, x, y));
    }
  }
  const faults = [];
  const small = [];
  const cells = [...document.querySelectorAll('.urc-cell:not([data-place="ground"])')].filter(isShown);
  const dock = [...document.querySelectorAll(".urc-stop-button, .urc-who, .urc-take, .urc-verbs > *, .urc-drawer-handle")].filter(isShown);
  const name = (el) => (el.dataset.config ? JSON.parse(el.dataset.config).slot : el.className);
  const scrolls = stage.scrollHeight > stage.clientHeight + SLACK;
  // Captions and buttons of the background are above the widgets on a phone in portrait.
  const isAbove = matchMedia("(width < 37.5rem)").matches;
  const floats = isAbove ? [] : [...document.querySelectorAll('[data-place="ground"] [data-floats]')].filter((el) => isShown(el) && el.textContent.trim());
  const pairs = [...cells, ...floats, ...dock].flatMap((one, index, all) => all.slice(index + 1).map((other) => [one, other]));
  for (const [one, other] of pairs) {
    // A cell may scroll below STOP.
    if (scrolls && dock.includes(other) && !dock.includes(one)) continue;
    const [a, b] = [boxOf(one), boxOf(other)];
    const [wide, high] = [Math.min(a.right, b.right) - Math.max(a.left, b.left), Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top)];
    if (wide > SLACK && high > SLACK) faults.push(`${name(one)} lies on ${name(other)}: ${Math.round(wide)} × ${Math.round(high)} px`);
  }
  for (const cell of cells) {
    const { left, right, top, bottom } = boxOf(cell);
    const over = Math.max(room.left - left, right - room.right, scrolls ? 0 : bottom - room.bottom, scrolls ? 0 : room.top - top);
    if (over > SLACK) faults.push(`${name(cell)} is ${Math.round(over)} px out of the stage`);
  }
  // Texts that their own box cuts: an ellipsis, or lines that are hidden. Lists that scroll are no cut.
  const walker = document.createTreeWalker(document.querySelector("main") ?? document.body, NodeFilter.SHOW_TEXT);
  const range = document.createRange();
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const text = node.textContent.trim();
    const owner = node.parentElement;
    if (!text || !owner || owner.closest(".urc-hidden, script, style, template, option, [data-text-cut]")) continue;
    if (!owner.checkVisibility({ opacityProperty: true, visibilityProperty: true })) continue;
    range.selectNodeContents(node);
    const box = range.getBoundingClientRect();
    if (box.width === 0) continue;
    const drawing = owner.closest("svg");
    const drawn = drawing?.viewBox.baseVal;
    const zoom = drawing && drawn?.width ? Math.min(boxOf(drawing).width / drawn.width, boxOf(drawing).height / drawn.height) : 1;
    const px = zoom * parseFloat(getComputedStyle(owner).fontSize);
    if (px > 0 && px < 13.9) small.push(`“${text}” has ${Math.round(10 * px) / 10} px`);
    for (let el = owner; el && el !== document.body && el !== stage; el = el.parentElement) {
      const style = getComputedStyle(el);
      if (/auto|scroll/.test(style.overflowX + style.overflowY) || style.clipPath !== "none") break;
      const isClipping = style.overflowX === "hidden" || style.overflowX === "clip";
      if (!isClipping) continue;
      const frame = boxOf(el);
      // Rows wholly out of sight, as the rest of a long legend, are left out, not cut.
      if (box.top >= frame.bottom - 1 || box.bottom <= frame.top + 1) break;
      const across = Math.max(frame.left - box.left, box.right - frame.right);
      const down = Math.max(frame.top - box.top, box.bottom - frame.bottom);
      if (across > 2 || down > box.height / 3) faults.push(`“${text}” is cut by ${el.className || el.tagName}: ${Math.round(across)}, ${Math.round(down)} px`);
      break;
    }
  }
  if (stage.scrollWidth > stage.clientWidth + SLACK) faults.push("the stage scrolls sideways");
  const sticks = [...document.querySelectorAll(".joystick-face")].filter(isShown).map(boxOf);
  const sizes = sticks.map(({ width, height }) => Math.min(width, height));
  if (Math.max(0, ...sizes) - Math.min(...sizes) > SLACK) faults.push(`sticks of different sizes: ${sizes.join(", ")}`);
  // On a phone in portrait, the sticks are above STOP until the page is scrolled, except with large text.
  const stop = document.querySelector(".urc-stop-button");
  const isUpright = matchMedia("(width < 37.5rem) and (height >= 40rem)").matches;
  const isUsual = parseFloat(getComputedStyle(document.documentElement).fontSize) <= 16;
  for (const { bottom } of stop && isUpright && isUsual && stage.scrollTop === 0 ? sticks : []) {
    const under = bottom - boxOf(stop).top;
    if (under > SLACK) faults.push(`a stick is ${Math.round(under)} px under STOP`);
  }
  // A finger must reach the whole stick without scrolling, unless the widgets are below the background.
  const isOver = document.querySelector('[data-place="ground"]') !== null && matchMedia("(width >= 37.5rem)").matches;
  for (const { bottom } of isOver ? sticks : []) {
    if (bottom > Math.min(innerHeight, room.bottom) + SLACK) faults.push(`a stick is ${Math.round(bottom - innerHeight)} px below the screen`);
  }
  // The horizon must not cover the aircraft's symbol.
  const symbol = document.querySelector('[data-place="ground"] .attitude-symbol');
  if (symbol && isShown(symbol)) {
    const { left, top } = boxOf(symbol);
    const layers = document.elementsFromPoint(left + 4, top);
    const world = layers.findIndex((el) => el.closest(".attitude-world"));
    const front = layers.indexOf(symbol);
    if (front < 0 || (world >= 0 && world < front)) faults.push("the horizon covers the aircraft's symbol");
  }
  const edges = sticks.map(({ left, right }) => Math.min(left, innerWidth - right));
  const gap = sticks.length > 1 ? Math.max(...sticks.map(({ left }) => left)) - Math.min(...sticks.map(({ right }) => right)) : null;
  const isOverGround = document.querySelector('[data-place="ground"]') !== null;
  return {
    ground: Math.round((100 * ground) / inside),
    image: Math.round((100 * image) / inside),
    clear: Math.round((100 * image) / Math.max(1, seen)),
    bars: Math.round((1000 * bars) / (bars + inside)) / 10,
    isPicture: document.querySelector('[data-place="ground"][data-picture]') !== null,
    isOverGround, scrolls, faults, small, edges, sizes, gap,
  };
}
