// @ts-check
/**
 * Moves of a pointer as they come, where browsers keep them back for the next frame.
 *
 * Raw events tell them at once, but only in secure contexts, and a dashboard in a local network is
 * none. What browsers have everywhere is a canvas that is drawn without waiting for the frame: they
 * hand on the moves of a pointer that went down on one as they come. So one that shows nothing lies
 * over the element. Where a browser knows no such canvas, moves come with the frames, as ever.
 */

/** @param {HTMLElement} el what a pointer goes down on; it has to hear of it from what is inside */
export function hurryMoves(el) {
  if ("onpointerrawupdate" in window) return;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 1;
  const pen = canvas.getContext("2d", { desynchronized: true });
  if (!pen?.getContextAttributes?.().desynchronized) return;
  canvas.ariaHidden = "true";
  Object.assign(canvas.style, { position: "absolute", inset: "0", width: "100%", height: "100%" });
  if (getComputedStyle(el).position === "static") el.style.position = "relative";
  el.append(canvas);
}
