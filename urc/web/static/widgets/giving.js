// @ts-check
/**
 * What widgets that give commands need again and again: `import { Giver, slide } from "urc/giving"`.
 *
 * Knows no socket and no store; a widget brings its own `send`.
 */

export { boundsOf, keyed, snapped } from "./bounds.js";
export { Giver } from "./giver.js";
export { grasp, isDown } from "../control/grasp.js";
export { whenPressed } from "../control/press.js";
export { Setpoint } from "./setpoint.js";
export { SetpointFace } from "./setpoint_face.js";
export { slide } from "../control/slide.js";
export { Wish } from "./wish.js";
