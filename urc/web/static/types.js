// @ts-check
/**
 * The shapes that the page's modules share. Types only; nothing here runs.
 *
 * @typedef {boolean | number | string | null} Value What a signal may hold; null is "not available".
 * @typedef {"" | "lolo" | "low" | "high" | "hihi"} Alarm The limit that a value has passed.
 * @typedef {"live" | "stale" | "gone" | "none"} State
 *   live: new enough. stale: old, or its line is down; shown grey with its age. gone: so old that it
 *   is no longer shown. none: there was never one, or the robot says it isn't available.
 *
 * @typedef {object} Signal What a value means, as the server declares it.
 * @property {string} name
 * @property {string} type
 * @property {string} [title]
 * @property {string} [unit]
 * @property {number} [min]
 * @property {number} [max]
 * @property {number} [precision]
 * @property {Record<string, string>} [states]
 * @property {Partial<Record<"lolo" | "low" | "high" | "hihi", number>>} [limits]
 * @property {number} [stale_after_s]
 * @property {string[]} [sources]
 *
 * @typedef {object} Reading One input of a widget at this moment.
 * @property {Value} value null in the states `gone` and `none`.
 * @property {State} state
 * @property {Alarm} alarm
 * @property {string} text The value for people: precision applied, "—" when there is none.
 * @property {string} age Its age for people, as "4 s"; "" while it is live.
 * @property {number} time When it was measured, in seconds on the page's own clock.
 * @property {number} serial Grows with each new reading, also of an equal value.
 * @property {Signal} signal
 *
 * @typedef {object} Outlet One bound output of a widget at this moment.
 * @property {boolean} isReady Whether its command can be given now.
 * @property {string} reason Why not, for people; "" when it can.
 * @property {boolean} isAnswered Whether the robot says that the command was done; else it is done
 *   when it is sent.
 *
 * @typedef {object} Link
 * @property {string} transport
 * @property {"idle" | "connecting" | "live" | "silent" | "lost"} state
 * @property {string} address
 * @property {number} since
 * @property {string} detail
 * @property {number} attempts
 * @property {number} faults
 *
 * @typedef {object} Line
 * @property {number} age
 * @property {"info" | "warning" | "error"} level
 * @property {string} source
 * @property {string} text
 *
 * @typedef {object} Hello
 * @property {string} robot
 * @property {string} title
 * @property {number} now
 * @property {Signal[]} signals
 *
 * @typedef {object} Values
 * @property {number} n
 * @property {number[]} i
 * @property {Value[]} v
 * @property {number[]} a
 * @property {Alarm[]} [s]
 *
 * @typedef {object} Reply
 * @property {number} id
 * @property {boolean} ok
 * @property {Record<string, Value>} [values]
 * @property {string} [code]
 * @property {string} [message]
 *
 * @typedef {object} Lease Who has the controls of the robot.
 * @property {string} you This page.
 * @property {string} name What the others call it.
 * @property {number} epoch
 * @property {{id: string, name: string} | null} holder
 * @property {{id: string, name: string} | null} asker
 * @property {number} left Milliseconds until the asker gets them.
 * @property {string} latched Who pressed STOP; "" while nothing is latched.
 * @property {boolean} confirmed Whether the robot's lines have taken the stop.
 * @property {boolean} drives Whether this page may drive.
 * @property {boolean} forces Whether it may take the controls from whoever has them.
 *
 * @typedef {object} Hand What holds a control, at this moment.
 * @property {"pointer" | "keys" | "pad"} kind
 * @property {number} x Where the pointer is, in CSS pixels of the window.
 * @property {number} y
 * @property {number} startX Where it went down.
 * @property {number} startY
 * @property {ReadonlySet<string>} keys Codes of the keys that are down, as "ArrowUp".
 * @property {[number, number]} axes The stick of a gamepad: right and down are positive, -1 to 1.
 *
 * @typedef {"idle" | "asking" | "held" | "spent"} HoldPhase
 *   asking: held, and the controls are not granted yet. spent: stopped or refused; nothing is sent
 *   before it is let go and held anew.
 *
 * @typedef {object} HoldState
 * @property {HoldPhase} phase
 * @property {string} reason Why it is spent, for people.
 * @property {Record<string, Value> | null} values What was sampled last; null while nothing holds it.
 *
 * @typedef {object} HoldSpec
 * @property {HTMLElement} el What is held; it takes the focus.
 * @property {string[]} keys Codes of the keys that hold it while it has the focus.
 * @property {"" | "left" | "right"} [pad] Stick of a gamepad that moves it, while the shoulder
 *   button beside it is down.
 * @property {(hand: Hand) => Record<string, Value>} sample Returns the values by the names of the
 *   output's arguments. Called in each animation frame while it is held; must be quick.
 * @property {(state: HoldState) => void} show Called when any of it has changed.
 *
 * @typedef {object} Context What a widget is given, and all it may use.
 * @property {HTMLElement} el Its rendered template's parent: the cell.
 * @property {Readonly<Record<string, unknown>>} options
 * @property {(input: string, listener: (reading: Reading) => void) => void} on
 *   Calls the listener in the animation frame after that input has changed.
 * @property {(output: string, args?: Record<string, Value>) => Promise<Record<string, Value>>} send
 *   Runs the command bound to the output, with arguments by the names of the widget's manifest;
 *   rejects with an Error that says why it was not done.
 * @property {(output: string, spec: HoldSpec) => void} hold
 *   Makes an element the grip of a held command: the page samples it, lets go, and says why.
 * @property {() => void} stop Stops the robot, whoever drives it.
 * @property {(listener: (state: StopState) => void) => void} onStop Calls the listener now, and
 *   whenever what is known of STOP changes.
 * @property {AbortSignal} signal Aborted when the widget ends; give it to every listener.
 *
 * @typedef {object} StopState
 * @property {"" | "sending" | "sent" | "confirmed" | "latched" | "failed"} phase How far STOP has
 *   got: handed over, latched by the server, taken by the robot's line. "" while the robot may be
 *   driven.
 * @property {boolean} isLatched
 * @property {boolean} isConfirmed
 * @property {string} by Who pressed it.
 * @property {string} fault Why it could not reach the robot now; "" when it can.
 *
 * @typedef {object} Instance
 * @property {(readings: Readonly<Record<string, Reading>>, outputs: Readonly<Record<string, Outlet>>) => void} [update]
 *   Called in an animation frame when any input or output has changed, with all that are bound.
 * @property {(size: {width: number, height: number}) => void} [resize] The cell's size in CSS pixels.
 * @property {() => void} [destroy]
 *
 * @typedef {object} WidgetModule
 * @property {{mount: (ctx: Context) => Instance | undefined | Promise<Instance | undefined>}} default
 */
export {};
