// @ts-check
/**
 * The toolkit for widgets with commands: `import { Giver, slide } from "urc/giving"`.
 *
 * It knows no socket and no store; a widget passes its own `send`.
 */

export { boundsOf, keyed, snapped } from "./bounds.js";
export { Giver } from "./giver.js";
export { grasp, isDown } from "../control/grasp.js";
export { whenPressed } from "../control/press.js";
export { Setpoint } from "./setpoint.js";
export { SetpointFace } from "./setpoint_face.js";
export { slide } from "../control/slide.js";
export { Wish } from "./wish.js";
