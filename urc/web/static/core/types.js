// @ts-check
/**
 * The shapes that the page's modules share. Types only; nothing here runs.
 *
 * @typedef {boolean | number | string | null} Value A plain value; null is "not available".
 * @typedef {Value | readonly Value[]} Given What an argument of a command may be.
 * @typedef {Value | readonly Value[] | Readonly<Record<string, unknown>>} Held What a signal may
 *   hold: a plain value; of an array, its elements; of an object, its fields; of an image or blob,
 *   how many `bytes` it has.
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
 * @property {"FLU" | "FRD" | "ENU" | "NED" | "bearing"} [axes] Which way its axes point.
 * @property {number} [edition] Of what the server said when a conversion was made.
 *
 * @typedef {object} Reading One input of a widget at this moment.
 * @property {Held} value null in the states `gone` and `none`; in the unit that the widget's
 *   manifest asks for, else in the signal's.
 * @property {State} state
 * @property {Alarm} alarm
 * @property {string} text The value for people: in their unit, precision applied, "—" when there is
 *   none.
 * @property {string} unit Symbol of the unit that `text` is in; "" when there is none.
 * @property {string} age Its age for people, as "4 s"; "" while it is live.
 * @property {number} time When it was measured, in seconds on the page's own clock.
 * @property {number} serial Grows with each new reading, also of an equal value.
 * @property {Signal} signal
 * @property {Picture | null} image Of an image or blob: the newest that has come.
 *
 * @typedef {object} Picture An image as it came, not decoded.
 * @property {Blob} blob
 * @property {string} type Its media type, as "image/jpeg".
 * @property {number} serial Grows with each new one.
 *
 * @typedef {object} Conversion From a signal's unit to another: value · factor + offset.
 * @property {number} factor
 * @property {number} offset
 * @property {string} symbol Of the unit that it leads to.
 *
 * @typedef {object} Outlet One bound output of a widget at this moment.
 * @property {boolean} isReady Whether its command can be given now.
 * @property {string} reason Why not, for people; "" when it can.
 * @property {boolean} isAnswered Whether the robot says that the command was done; else it is done
 *   when it is sent.
 *
 * @typedef {object} Argument One argument of a command, as the driver declares it.
 * @property {"integer" | "number" | "boolean" | "string" | "array"} type
 * @property {string} title
 * @property {string} unit
 * @property {number | null} min
 * @property {number | null} max
 * @property {Value[]} choices
 * @property {Value} default
 * @property {boolean} allowsControl Whether a text may hold control characters.
 *
 * @typedef {object} Question What people are asked before a command.
 * @property {string} argument Only before one value of this argument; "": before all.
 * @property {string} value That value, as it is written.
 * @property {string} text
 * @property {"normal" | "hazardous"} level
 * @property {boolean} isTwoPerson
 *
 * @typedef {object} Described What a bound command is.
 * @property {string} command Its name.
 * @property {string} title What it is called; "" when the driver does not say.
 * @property {Readonly<Record<string, Argument>>} arguments Those that the binding does not fix, by
 *   the names of the widget's output where it has any, else by those of the command.
 * @property {readonly Question[]} asks
 * @property {readonly {text: string, what: string}[]} steps Of a sequence, without those inside of
 *   others: a text that can be translated, and its `{what}`.
 *
 * @typedef {object} Progress Where a sequence stands.
 * @property {string} command
 * @property {number} place Steps that were begun.
 * @property {number} of
 * @property {"idle" | "running" | "paused"} state
 * @property {string} reason Why it ended without success.
 *
 * @typedef {"take" | "ask" | "yes" | "no" | "force" | "leave" | "reset"} Wish What a person may want
 *   with the controls.
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
 * @property {Held[]} v
 * @property {number | number[]} a One for all where all are equally old.
 * @property {Alarm[]} [s]
 * @property {Record<number, number>} [e] Of signals of which each reading counts: the number of the
 *   first one in this frame, by index.
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
 * @property {number} stops How often it was pressed.
 * @property {boolean} confirmed Whether the robot's lines have taken the stop.
 * @property {boolean} drives Whether this page may drive.
 * @property {boolean} forces Whether it may take the controls from whoever has them.
 * @property {string} spare Names its seat on a second line; "" when it may have none.
 *
 * @typedef {object} Hand What holds a control, at this moment.
 * @property {"pointer" | "keys" | "pad" | "stay"} kind stay: the pointer has let it go, and it stays
 *   where it was put, since another hand is there.
 * @property {number} x Where the pointer is, in CSS pixels of the window.
 * @property {number} y
 * @property {number} startX Where it went down.
 * @property {number} startY
 * @property {ReadonlySet<string>} keys Codes of the keys that are down, as "ArrowUp".
 * @property {[number, number]} axes The stick of a gamepad: right and down are positive, -1 to 1.
 * @property {readonly [number, number, number, number]} [sticks] Both sticks of it, the left one first.
 * @property {readonly boolean[]} [buttons] Which of its buttons are down.
 *
 * @typedef {"idle" | "asking" | "held" | "spent"} HoldPhase
 *   asking: held, and the controls are not granted yet. spent: stopped or refused; nothing is sent
 *   before it is let go and held anew.
 *
 * @typedef {object} HoldState
 * @property {HoldPhase} phase
 * @property {string} reason Why it is spent, or why not all of it counts, for people.
 * @property {Record<string, Value> | null} values What was sampled last, 0 where another hand gives
 *   that already; null while nothing holds it.
 *
 * @typedef {object} HoldSpec
 * @property {HTMLElement} el What is held; it takes the focus.
 * @property {string[]} keys Codes of the keys that hold it while it has the focus.
 * @property {HTMLElement[]} [keysOn] Further elements where these keys count.
 * @property {() => "none" | "free" | "all"} [page] Which of these keys count on the whole page now:
 *   all but those typed as text, or only those that the element with the focus does not need.
 * @property {Record<string, () => void>} [taps] Codes of keys that do something once, by pressing.
 * @property {(way: "slower" | "faster") => void} [pace] A button of the gamepad steps the speed.
 * @property {boolean} [stays] Whether it stays where the pointer let it go, while another hand holds
 *   the robot's controls.
 * @property {(target: EventTarget | null) => boolean} [isFree] Whether a pointer that goes down on
 *   this element takes hold.
 * @property {"" | "left" | "right"} [pad] Stick of a gamepad that moves it, while the shoulder
 *   button beside it is down.
 * @property {(hand: Hand, dtS: number) => Record<string, Value>} sample Returns the values by the
 *   names of the output's arguments. Called when the hand moves and in each animation frame while it
 *   is held; must be quick. `dtS` is the seconds since the last call; 0 until motion may begin.
 * @property {(state: HoldState) => void} show Called when any of it has changed.
 *
 * @typedef {object} GateState
 * @property {boolean} isOpen Whether held controls count.
 * @property {number} leftS Seconds until it closes by itself; 0 for one that is held.
 * @property {string} reason Why it closed by itself, for people; "" otherwise.
 *
 * @typedef {object} GateSpec
 * @property {HTMLElement} el What is held, or pressed.
 * @property {boolean} isHeld Whether it must be held; else a press opens and closes it.
 * @property {number} timeoutMs One that is pressed closes when nothing was driven for so long.
 * @property {string} [key] Code of a key that holds it from anywhere in the page.
 * @property {"" | "left" | "right"} [pad] Shoulder button of a gamepad that holds it.
 * @property {(state: GateState) => void} show Called when any of it has changed, and in each frame
 *   while it is open.
 *
 * @typedef {object} PadView One gamepad at this moment.
 * @property {string} id
 * @property {number[]} axes
 * @property {boolean[]} buttons Which are down.
 * @property {import("../widgets/padmap.js").PadMap | null} map Where its sticks are; null when nobody knows.
 * @property {boolean} isStandard Whether the browser knows its layout.
 * @property {boolean} isUsed Whether it is the one that moves something.
 *
 * @typedef {object} PadDesk
 * @property {() => PadView[]} views
 * @property {(id: string, map: import("../widgets/padmap.js").PadMap | null) => void} setMap Keeps a mapping on
 *   this device; null: as the browser says.
 *
 * @typedef {object} Context What a widget is given, and all it may use.
 * @property {HTMLElement} el Its rendered template's parent: the cell.
 * @property {Readonly<Record<string, unknown>>} options
 * @property {(input: string, listener: (reading: Reading) => void) => void} on
 *   Calls the listener in the animation frame after that input has changed.
 * @property {(input: string, listener: (reading: Reading, missed: number) => void) => void} each
 *   Calls the listener with the reading that is known, and then with each one when it comes, as it
 *   was then, also while the cell cannot be seen; `missed` is how many were lost before it. For
 *   inputs that the manifest marks with `each`, of widgets that live in the page.
 * @property {(output: string, args?: Record<string, Given>) => Promise<Record<string, Value>>} send
 *   Runs the command bound to the output, with arguments by the names of the widget's manifest;
 *   rejects with an Error that says why it was not done.
 * @property {(output: string, spec: HoldSpec) => void} hold
 *   Makes an element the grip of a held command: the page samples it, lets go, and says why.
 * @property {(spec: GateSpec) => void} gate
 *   Makes an element a dead-man control: without one that is open nothing held counts.
 * @property {PadDesk} pads The gamepads, and where their sticks are.
 * @property {() => void} stop Stops the robot, whoever drives it.
 * @property {(listener: (state: StopState) => void) => void} onStop Calls the listener now, and
 *   whenever STOP is pressed or what is known of it changes. What gives commands by itself ends then.
 * @property {(output: string) => Described | null} command What is bound to an output; null when
 *   nothing is.
 * @property {(output: string, verb: "pause" | "step" | "resume" | "abort") => void} steer Lets the
 *   sequence bound to an output pause, do one step, go on, or end.
 * @property {{read: () => unknown, write: (value: unknown) => void}} memory What this widget keeps
 *   while the browser's tab is open, also over a reload: something that JSON can hold, or null.
 * @property {(wish: Wish) => void} drive Says what this person wants with the controls.
 * @property {AbortSignal} signal Aborted when the widget ends; give it to every listener.
 * @property {<T extends keyof Topics>(what: T, listener: (news: Topics[T]) => void) => void} follow
 *   Calls the listener in the next animation frame, and in one after every change, with what the
 *   page knows beside signals.
 * @property {(input: string, listener: (bitmap: ImageBitmap, reading: Reading) => void) => void} picture
 *   Decodes the images of an input: the newest wins, what is late is dropped. The bitmap is closed
 *   when the next one comes: draw it at once.
 * @property {(input: string, places: readonly number[]) => void} look Chooses the images of an input
 *   that the widget shows, by their places (0 first); the server sends no others. At first, all.
 * @property {(text: string, names?: Record<string, string | number>) => string} t The text in the
 *   reader's language, with "{name}" replaced.
 * @property {(input: string) => {symbol: string, factor: (value: number) => number}} unit In which
 *   unit people want to see that input, and how a value gets there.
 * @property {(module: string) => Promise<void>} style Loads the style sheet of a third-party module.
 *
 * @typedef {object} Topics What `follow` tells of.
 * @property {{isUp: boolean, links: readonly Link[], isReplay?: boolean}} links The lines to the robot;
 *   none are known while the page has no connection to URC. In a replay they are what they were.
 * @property {{lines: readonly LogLine[], missing: number}} log The newest lines, oldest first, and
 *   how many were lost before they reached this page.
 * @property {{lease: Lease | null, isMine: boolean, refusal: string}} lease Who has the controls.
 * @property {readonly Alert[]} alarms Every signal that is past a limit now, the worst first.
 * @property {{limited: number, known: number}} watched How many signals have a limit, and of how many
 *   of them a value is known that is not old.
 * @property {{isUp: boolean, tripMs: number | null, failures: number, skewMs: number | null, messages: number, bytes: number}} latency
 *   The way to URC and back, how far this device's clock is before URC's, null while they are
 *   unknown; and what has come since the page was opened.
 * @property {Readonly<Record<string, Progress>>} sequences Where each sequence stands, by its name;
 *   those that were never run are missing.
 * @property {{name: string}} theme Changes when the colours do.
 *
 * @typedef {object} LogLine
 * @property {number} number Of the line in its session.
 * @property {number} time When it was written, in milliseconds since 1970.
 * @property {Line["level"]} level
 * @property {string} source
 * @property {string} text
 *
 * @typedef {object} Alert
 * @property {string} signal Its name.
 * @property {string} title What it is called.
 * @property {Alarm} alarm
 * @property {string} text The value for people.
 * @property {string} unit
 * @property {string} age Of the value, for people, as "4 s"; "" while it is live.
 * @property {number} since When it was first seen past this limit, in seconds on the page's clock.
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
 *   Called in an animation frame when any input or output has changed, with all that are bound. An
 *   input that takes many signals is an array of readings: `many(readings.series)` of urc/kit.
 * @property {(size: {width: number, height: number}) => void} [resize] The cell's size in CSS pixels.
 * @property {() => void} [destroy]
 *
 * @typedef {object} WidgetModule
 * @property {{mount: (ctx: Context) => Instance | undefined | Promise<Instance | undefined>}} default
 */
export {};
