// @ts-check
/**
 * The geometry of the two drawings of a battery. Pure.
 *
 * @typedef {{x: number, y: number, w: number, h: number}} Box A rectangle in the units of a drawing.
 */

/** Inside of each drawing's shell, as in the template. @type {Record<string, Box>} */
export const INSIDE = {
  lying: { x: 12, y: 12, w: 168, h: 88 },
  standing: { x: 12, y: 28, w: 88, h: 168 },
};

/** Distance of a limit mark's tip from the inside, its height, and half its width. */
const TIP = 12;
const HIGH = 8;
const HALF = 5;

/**
 * Return two triangles that point at the shell from outside, at a limit.
 *
 * @param {Box} inside
 * @param {number} place 0..1
 * @param {boolean} isLying
 */
export function mark({ x, y, w, h }, place, isLying) {
  if (isLying) {
    const at = (x + place * w).toFixed(1);
    const [above, below] = [y - TIP, y + h + TIP];
    return (
      `M${at} ${above}l-${HALF}-${HIGH}h${2 * HALF}z` +
      `M${at} ${below}l-${HALF} ${HIGH}h${2 * HALF}z`
    );
  }
  const at = (y + (1 - place) * h).toFixed(1);
  const [left, right] = [x - TIP, x + w + TIP];
  return (
    `M${left} ${at}l-${HIGH}-${HALF}v${2 * HALF}z` + `M${right} ${at}l${HIGH}-${HALF}v${2 * HALF}z`
  );
}
