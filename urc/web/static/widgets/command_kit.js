// @ts-check
/**
 * The toolkit for widgets with commands: `import { CommandState, slide } from "urc/command_kit"`.
 *
 * The toolkit uses no socket and no store; a widget passes its own `send`.
 */

export { boundsOf, keyed, snapped } from "./number_bounds.js";
export { CommandState } from "./command_state.js";
export { grasp, isDown } from "../control/pointer_capture.js";
export { whenPressed } from "../control/pointer_press.js";
export { Setpoint } from "./setpoint.js";
export { SetpointView } from "./setpoint_view.js";
export { slide } from "../control/slide_to_confirm.js";
export { PendingValue } from "./pending_value.js";
