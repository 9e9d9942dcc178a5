// Run in the gallery's page, or in a robot's, with the selector of the cells. Returns per cell what
// hangs over, which text, drawing or control is cut, which word of a button is broken, and whether
// there is nothing at all. A cell that has no place on a screen of this size is none. An ellipsis is
// meant, and so is what can be scrolled to; a text that is only for screen readers is not seen; the
// figures of a scale that moves (data-scale) come and go at its ends.
(selector) => {
  const SLACK = 2;
  const clips = (style) => /strict|content|paint/.test(style.contain) ||
    [style.overflowX, style.overflowY].some((each) => each !== "visible");
  const scrolls = (style) => /auto|scroll/.test(style.overflowX + style.overflowY);
  // A word of a button that stands in two lines, though it is short enough for one.
  const broken = (node) => {
    if (!node.parentElement.closest("button, label")) return [];
    return [...node.textContent.matchAll(/(?<!\S)\p{L}{2,12}(?!\S)/gu)].flatMap(({ 0: word, index }) => {
      const range = document.createRange();
      range.setStart(node, index);
      range.setEnd(node, index + word.length);
      const lines = new Set([...range.getClientRects()].map(({ top }) => Math.round(top)));
      return lines.size > 1 ? [word] : [];
    });
  };
  const found = [];
  for (const cell of document.querySelectorAll(selector)) {
    if (!cell.checkVisibility()) continue;
    const { stateName, widget, config = "{}" } = cell.dataset;
    const name = stateName ? `${widget} ${stateName}` : `slot ${JSON.parse(config).slot}`;
    const over = cell.scrollWidth - cell.clientWidth;
    if (over > SLACK) found.push(`${name}: ${over} px wider than its cell`);
    const room = cell.getBoundingClientRect();
    let isBlank = !cell.querySelector("canvas, svg, img, input, button");
    const words = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
    for (let node = words.nextNode(); node; node = words.nextNode()) {
      const text = node.textContent.trim();
      const el = node.parentElement;
      if (!text || !el.checkVisibility({ opacityProperty: true, visibilityProperty: true })) continue;
      isBlank = false;
      if (el.closest(".urc-hidden, [data-scale], [data-text-cut], option, title, desc, script, style")) continue;
      for (const word of broken(node)) found.push(`${name}: ${JSON.stringify(word)} is broken`);
      const range = document.createRange();
      range.selectNodeContents(node);
      const boxes = [...range.getClientRects()].filter(({ width, height }) => width > 1 && height > 1);
      if (boxes.length === 0) continue;
      let box = { left: room.left, top: room.top, right: room.right, bottom: room.bottom };
      let isMeant = false;
      for (let up = el; up && up !== cell; up = up.parentElement) {
        const style = getComputedStyle(up);
        const isHidden = style.clipPath !== "none" || style.position === "absolute" && up.clientWidth <= 1;
        if (isHidden || style.textOverflow === "ellipsis" || style.webkitLineClamp !== "none" ||
            scrolls(style) || up instanceof SVGElement && up.tagName !== "svg" && style.display === "none") {
          isMeant = true;
          break;
        }
        if (!clips(style) || up instanceof SVGElement) continue;
        const edge = up.getBoundingClientRect();
        box = { left: Math.max(box.left, edge.left), top: Math.max(box.top, edge.top),
                right: Math.min(box.right, edge.right), bottom: Math.min(box.bottom, edge.bottom) };
      }
      if (isMeant) continue;
      for (const each of boxes) {
        const cut = Math.max(box.left - each.left, box.top - each.top, each.right - box.right,
                             each.bottom - box.bottom);
        // A line is higher than its letters: a fifth of it may be out of sight.
        const slack = Math.max(SLACK, each.height / 5);
        if (cut > slack) {
          found.push(`${name}: ${Math.round(cut)} px of ${JSON.stringify(text.slice(0, 40))} are cut`);
          break;
        }
      }
    }
    // A canvas may be larger than its visible part, and so may the drawing of a map.
    for (const el of cell.querySelectorAll("svg, button, input, select, [role=slider]")) {
      if (!el.checkVisibility({ opacityProperty: true, visibilityProperty: true })) continue;
      if (el.closest(".urc-hidden, .leaflet-overlay-pane") || el.parentElement.closest("svg")) continue;
      const each = el.getBoundingClientRect();
      if (each.width <= 1 || each.height <= 1) continue;
      let up = el.parentElement;
      while (up !== cell && !scrolls(getComputedStyle(up))) up = up.parentElement;
      if (up !== cell) continue;
      const cut = Math.max(room.left - each.left, room.top - each.top, each.right - room.right,
                           each.bottom - room.bottom);
      const called = [el.localName, ...el.classList].join(".");
      if (cut > SLACK) found.push(`${name}: ${Math.round(cut)} px of ${called} are cut`);
    }
    if (isBlank) found.push(`${name}: nothing is shown`);
  }
  return found;
}
