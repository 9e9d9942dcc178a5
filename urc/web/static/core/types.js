// @ts-check
/**
 * Types of the page's modules. The file contains no code.
 *
 * @typedef {boolean | number | string | null} Value A plain value; null means "not available".
 * @typedef {Value | readonly Value[]} Given Value of a command's argument.
 * @typedef {Value | readonly Value[] | Readonly<Record<string, unknown>>} Held Value of a signal: a
 *   plain value, an array's elements, or an object's fields. An image or blob is an object with its
 *   number of `bytes`.
 * @typedef {"" | "lolo" | "low" | "high" | "hihi" | "minor" | "major"} Alarm The exceeded limit, or the
 *   severity of an alarm state.
 * @typedef {"low" | "medium" | "high"} AlarmPriority
 * @typedef {"live" | "stale" | "gone" | "none"} State
 *   live: recent. stale: old, or its link is down; shown in grey with its age. gone: too old to be
 *   shown. none: never received, or not available according to the robot.
 *
 * @typedef {object} Signal Declaration of a signal, from the server.
 * @property {string} name
 * @property {string} type
 * @property {string} [title]
 * @property {string} [unit]
 * @property {number} [min]
 * @property {number} [max]
 * @property {number} [precision]
 * @property {Record<string, string>} [states]
 * @property {Partial<Record<"lolo" | "low" | "high" | "hihi", number>>} [limits]
 * @property {boolean} [has_alarms] Whether a limit or a state causes an alarm.
 * @property {Record<string, AlarmPriority>} [priorities] Priority of each limit and alarm state; omitted
 *   if all have their usual priority.
 * @property {number} [stale_after_s]
 * @property {number} [frozen_after_s] Time after which equal images of a video count as one image.
 * @property {string[]} [sources]
 * @property {"FLU" | "FRD" | "ENU" | "NED" | "bearing"} [axes] Axis convention.
 * @property {number} [edition] Number of the server's state at the time of a conversion.
 *
 * @typedef {object} Reading Current value of one input of a widget.
 * @property {Held} value Value in the unit of the widget's manifest, or else in the signal's unit;
 *   null in the states `gone` and `none`.
 * @property {State} state
 * @property {Alarm} alarm
 * @property {AlarmPriority | ""} [priority] Priority of the alarm; "" without an alarm.
 * @property {string} text Value for people, in the displayed unit and precision; "—" without a value.
 * @property {string} unit Symbol of the unit of `text`, or "".
 * @property {string} age Age for people, such as "4 s"; "" while it is live.
 * @property {number} time Time of the measurement, in seconds on the page's own clock.
 * @property {number} serial Increases with each new reading, even if the value is equal.
 * @property {Signal} signal
 * @property {Picture | null} image Newest image, for signals of type image or blob.
 * @property {VideoImage | null} [video] Newest decoded image, for signals of type video.
 *
 * @typedef {object} Picture An encoded image.
 * @property {Blob} blob
 * @property {string} type Media type, such as "image/jpeg".
 * @property {number} serial Increases with each new image.
 * @property {string} signal
 * @property {number} number Number of the image on the server.
 * @property {number} timeMs Time of the image on this page's clock.
 * @property {boolean | undefined} [isRepeated] Whether the camera repeats the image.
 *
 * @typedef {object} VideoImage A decoded image of a video.
 * @property {ImageBitmap} bitmap Closed as soon as the next image is stored; copy it to keep it.
 * @property {number} serial Increases with each new image.
 * @property {string} signal
 * @property {number} number Number of its access unit.
 * @property {number} timeMs Time of the image on this page's clock; of a repeated image, the first one's.
 * @property {number | undefined} [firstNumber] Number of the image that the camera repeats.
 * @property {import("../live/videos.js").Quality | undefined} [quality] What the page receives of the video.
 *
 * @typedef {object} Conversion Conversion from a signal's unit to another: value · factor + offset.
 * @property {number} factor
 * @property {number} offset
 * @property {string} symbol Symbol of the target unit.
 *
 * @typedef {object} Outlet State of a widget's bound output.
 * @property {boolean} isReady Whether its command can be sent now.
 * @property {string} reason Displayed reason why the command cannot be sent; "" if it can.
 * @property {boolean} isAnswered Whether the robot acknowledges the command; otherwise, it ends
 *   once it is sent.
 * @property {string} [notice] Displayed reason why the command may have no effect, although it can be
 *   sent; "" or omitted if there is none.
 *
 * @typedef {object} Argument One argument of a command, as the driver declares it.
 * @property {string} [name]
 * @property {"integer" | "number" | "boolean" | "string" | "array"} type
 * @property {string} title
 * @property {string} unit
 * @property {number | null} min
 * @property {number | null} max
 * @property {Value[]} choices
 * @property {Value} default
 * @property {boolean} allowsControl Whether a text may contain control characters.
 *
 * @typedef {object} Question Confirmation of a command.
 * @property {string} argument Argument whose value needs the confirmation; "" for any call.
 * @property {string} value That value, as text.
 * @property {string} text
 * @property {"normal" | "hazardous"} level
 * @property {boolean} isTwoPerson
 *
 * @typedef {object} Described A bound command.
 * @property {string} command Its name.
 * @property {string} title Its title; "" if the driver has none.
 * @property {Readonly<Record<string, Argument>>} arguments Arguments without a fixed value in the
 *   binding, by the names of the widget's output or else of the command.
 * @property {readonly Question[]} asks
 * @property {readonly {text: string, what: string}[]} steps Steps of a sequence, without nested ones:
 *   a translatable text, and its `{what}`.
 *
 * @typedef {object} Progress State of a sequence.
 * @property {string} command
 * @property {number} place Number of begun steps.
 * @property {number} of
 * @property {"idle" | "running" | "paused"} state
 * @property {string} reason Reason for a failure.
 *
 * @typedef {"take" | "ask" | "yes" | "no" | "force" | "leave" | "reset"} PendingValue An operator's
 *   request about the controls.
 *
 * @typedef {object} Link
 * @property {string} transport
 * @property {"idle" | "connecting" | "live" | "silent" | "lost"} state
 * @property {string} address
 * @property {number} since
 * @property {string} detail
 * @property {number} attempts
 * @property {number} faults
 * @property {string} cause name of the cause of a lost connection, see connection_causes.js
 * @property {boolean} ready whether the connection is open and its login has ended, even if no data has arrived yet
 *
 * @typedef {object} TopicMismatch One difference between the driver's topics and a ROS robot's.
 * @property {string} code
 * @property {string} topic
 * @property {string} [found] Type or ROS version of the robot.
 * @property {string} [wanted] Type or ROS version of the driver.
 * @property {string[]} [commands] Commands that publish the topic.
 * @property {string[]} [signals] Signals that the topic sets.
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
 * @property {string} [pictures] Key for the socket for images.
 *
 * @typedef {object} Values
 * @property {number} n
 * @property {number[]} i
 * @property {Held[]} v
 * @property {number | number[]} a One number if all ages are equal.
 * @property {Alarm[]} [s]
 * @property {Record<number, number>} [e] Number of the first reading in this frame, by index, for
 *   signals for which every reading is sent.
 *
 * @typedef {object} Reply
 * @property {number} id
 * @property {boolean} ok
 * @property {Record<string, Value>} [values]
 * @property {string} [code]
 * @property {string} [message]
 *
 * @typedef {object} Lease The lease of the robot.
 * @property {string} you Identifier of this page.
 * @property {string} name Name of this page on other pages.
 * @property {number} epoch
 * @property {{id: string, name: string} | null} holder
 * @property {{id: string, name: string} | null} asker
 * @property {number} left Time until the asking page gets the controls, in milliseconds.
 * @property {string} latched Name of the operator who pressed STOP; "" while nothing is latched.
 * @property {number} stops Number of STOPs so far.
 * @property {boolean} confirmed Whether the robot's transports have accepted the stop, and the robot has answered all cancellations of goals.
 * @property {boolean} drives Whether this page may drive.
 * @property {boolean} forces Whether this page may take control from another page.
 * @property {string} spare Key for the redundant socket; "" if the page may not open one.
 * @property {Role | null} role Role of this page at the robot.
 * @property {number} [override] Time for which the holder may still drive without an image, in milliseconds.
 * @property {string} [limit] Why the robot's site limits the page's role; "" if it does not.
 *
 * @typedef {"watch" | "drive" | "maintain" | "administer"} Role Rights at a robot; each role includes
 *   the rights of the previous roles.
 *
 * @typedef {object} Hand Current input of a held control.
 * @property {"pointer" | "keys" | "pad" | "stay"} kind stay: the pointer was released, and the control
 *   keeps its position, since another control is held.
 * @property {number} x Position of the pointer, in CSS pixels of the window.
 * @property {number} y
 * @property {number} startX Position of the press.
 * @property {number} startY
 * @property {ReadonlySet<string>} keys Codes of the held keys, such as "ArrowUp".
 * @property {[number, number]} axes Stick of a gamepad: right and down are positive, -1 to 1.
 * @property {readonly [number, number, number, number]} [sticks] Both sticks, left stick first.
 * @property {readonly boolean[]} [buttons] Held state of its buttons.
 *
 * @typedef {"idle" | "asking" | "held" | "spent"} HoldPhase
 *   asking: held, but control is not granted yet. spent: stopped or refused; nothing is sent until
 *   a release and a new hold.
 *
 * @typedef {object} HoldState
 * @property {HoldPhase} phase
 * @property {string} reason Displayed reason why the hold is spent or only partly effective.
 * @property {Record<string, Value> | null} values Last sample, with 0 for arguments of another
 *   control; null while not held.
 *
 * @typedef {object} HoldSpec
 * @property {HTMLElement} el The held element, which receives the focus.
 * @property {string[]} keys Codes of the keys that hold the element while it has the focus.
 * @property {HTMLElement[]} [keysOn] Additional elements that accept these keys.
 * @property {() => "none" | "free" | "all"} [page] Keys that currently work on the whole page. all:
 *   all keys, except for typed text. free: keys that the focused element does not need.
 * @property {Record<string, () => void>} [taps] Codes of keys with a single action.
 * @property {(way: "slower" | "faster") => void} [pace] Handles a gamepad button for speed steps.
 * @property {boolean} [stays] Whether it keeps its position after the release of the pointer, while
 *   another control is held.
 * @property {(target: EventTarget | null) => boolean} [isFree] Whether a press on this element begins
 *   a hold.
 * @property {"" | "left" | "right"} [pad] Gamepad stick that moves the control while the shoulder
 *   button of that side is held.
 * @property {(hand: Hand, dtS: number) => Record<string, Value>} sample Returns the values by the names
 *   of the output's arguments. Called during a hold for each move of the input and in each animation
 *   frame; must be fast. `dtS` is the time since the last call, in seconds; 0 until motion may begin.
 * @property {(state: HoldState) => void} show Called for each change of the state.
 *
 * @typedef {object} GateState
 * @property {boolean} isOpen Whether held controls count.
 * @property {number} leftS Seconds until it closes automatically; 0 for a control that must be
 *   held.
 * @property {string} reason Displayed reason why it closed automatically, or "".
 *
 * @typedef {object} GateSpec
 * @property {HTMLElement} el The held or pressed element.
 * @property {boolean} isHeld Whether it must be held; otherwise, a press toggles it.
 * @property {number} timeoutMs Time without motion after which a toggled control closes.
 * @property {string} [key] Code of a key that holds the control from anywhere on the page.
 * @property {"" | "left" | "right"} [pad] Shoulder button of a gamepad that holds it.
 * @property {(state: GateState) => void} show Called for each change of the state, and in each frame
 *   while it is open.
 *
 * @typedef {object} PadView State of one gamepad.
 * @property {string} id
 * @property {number[]} axes
 * @property {boolean[]} buttons Held state of the buttons.
 * @property {import("../widgets/gamepad_map.js").PadMap | null} map Its mapping, or null if unknown.
 * @property {boolean} isStandard Whether the browser knows the layout.
 * @property {boolean} isUsed Whether it is the gamepad in use.
 *
 * @typedef {object} PadDesk
 * @property {() => PadView[]} views
 * @property {(id: string, map: import("../widgets/gamepad_map.js").PadMap | null) => void} setMap Stores a
 *   mapping on this device; null restores the browser's layout.
 *
 * @typedef {object} Context The interface between a widget and the page.
 * @property {HTMLElement} el The cell, parent of its rendered template.
 * @property {Readonly<Record<string, unknown>>} options
 * @property {(input: string, listener: (reading: Reading) => void) => void} on
 *   Calls the listener in the animation frame after a change of that input.
 * @property {(input: string, listener: (reading: Reading, missed: number) => void) => void} each
 *   Calls the listener with the last reading, and then immediately with each new reading, also for
 *   a hidden cell. `missed` is the number of lost readings before it. For inputs with `each` in the
 *   manifest, of widgets in the page.
 * @property {(output: string, args?: Record<string, Given>) => Promise<Record<string, Value>>} send
 *   Runs the command bound to the output, with arguments by the names of the widget's manifest; rejects
 *   with an Error that has the reason of a failure.
 * @property {(output: string, spec: HoldSpec) => void} hold
 *   Makes an element the handle of a held command. The page samples it, releases it, and reports
 *   reasons.
 * @property {(spec: GateSpec) => void} gate
 *   Makes an element a dead-man control. Held controls count only while a dead-man control is open.
 * @property {PadDesk} pads The gamepads and their mappings.
 * @property {() => void} stop Stops the robot, regardless of the operator in control.
 * @property {(listener: (state: StopState) => void) => void} onStop Calls the listener now, and for
 *   each press of STOP and each change of its state. A widget must end its own repeated commands then.
 * @property {(output: string) => Described | null} command The command of an output, or null.
 * @property {(output: string, verb: "pause" | "step" | "resume" | "abort") => void} steer Pauses, steps,
 *   resumes or ends the sequence of an output.
 * @property {{read: () => unknown, write: (value: unknown) => void}} memory Stored state of this widget
 *   for the lifetime of the browser's tab, also over a reload: a JSON value, or null.
 * @property {(wish: PendingValue) => void} drive Sends a request about the controls.
 * @property {AbortSignal} signal Aborted when the widget ends; pass it to every listener.
 * @property {<T extends keyof Topics>(what: T, listener: (news: Topics[T]) => void) => void} follow
 *   Calls the listener in the next animation frame, and in one after every change, with data of the
 *   page besides signals.
 * @property {(input: string, listener: (bitmap: ImageBitmap, reading: Reading) => void, failed?: (blob: Blob) => void) => void} picture
 *   Decodes the images of an input. Only the newest image counts; late images are dropped. The
 *   bitmap is closed when the next one arrives, so draw it immediately. `failed` receives an image
 *   that the browser cannot decode.
 * @property {(image: import("../control/shown_images.js").Numbered) => void} shown Reports that an image is drawn,
 *   for commands that require the operator to see it. `picture` reports its images automatically. In a
 *   frame, `shown` has no effect.
 * @property {(input: string, places: readonly number[]) => void} look Selects the visible images of
 *   an input by their indexes from 0; the server sends only these. By default, all images are
 *   visible.
 * @property {{may: () => boolean, acknowledge: (alerts: readonly Alert[]) => void, shelve: (alert: Alert, minutes: number) => void, open: () => void}} alarms
 *   Actions of the operator on alarms: whether they are allowed, acknowledge, shelve, and open the list.
 * @property {(text: string, names?: Record<string, string | number>) => string} t Returns the text in the
 *   user's language, with "{name}" replaced.
 * @property {(input: string) => {symbol: string, factor: (value: number) => number}} unit Displayed unit
 *   of an input, and the conversion to it.
 * @property {(module: string) => Promise<void>} style Loads the style sheet of a third-party module.
 *
 * @typedef {object} Topics Data of the topics for `follow`.
 * @property {{isUp: boolean, isRefused?: boolean, links: readonly Link[], isReplay?: boolean}} links The
 *   robot's transports; empty while the page has no connection to URC, or URC cannot open the robot
 *   (isRefused). A playback shows their state in the recording.
 * @property {{lines: readonly LogLine[], missing: number}} log The newest lines, oldest first, and
 *   the number of lines lost on their way to this page.
 * @property {{lease: Lease | null, isMine: boolean, refusal: string}} lease The lease.
 * @property {readonly Alert[]} alarms All alarms of the robot outside the normal state, most urgent
 *   first.
 * @property {{limited: number, known: number}} watched Number of signals with a limit, and of those with
 *   a recent value.
 * @property {{isUp: boolean, tripMs: number | null, failures: number, skewMs: number | null, messages: number, bytes: number, inputMs?: number | null}} latency
 *   Round trip to URC, and lead of this device's clock over URC's, null while unknown; also the traffic
 *   since the opening of the page, and the age of its newest tick at the robot's site, if this is
 *   another site.
 * @property {Readonly<Record<string, Progress>>} sequences State of each sequence by its name, without
 *   sequences that never ran.
 * @property {{isKnown: boolean, goals: readonly Goal[]}} goals Autonomous motion by the commands of
 *   the widget's outputs, sent from any page and not ended, oldest first. Not known until the server
 *   has told of goals in the robot's session. For widgets in the page.
 * @property {{name: string}} theme Changes whenever the colours change.
 *
 * @typedef {object} Goal Autonomous motion that has not ended.
 * @property {number} number
 * @property {string} output Output to whose command it belongs.
 * @property {Readonly<Record<string, number | readonly number[]>>} args Arguments that are numbers or
 *   lists of numbers, by the names of the widget's manifest.
 * @property {string} by Name of the operator who has sent it.
 * @property {boolean} isOurs Whether this page has sent it, since it was opened.
 * @property {number} since Time of its start, in seconds on the page's own clock.
 * @property {boolean} isLost Whether its outcome is unknown, so the robot may go on.
 *
 * @typedef {object} SentGoal A goal from the server, for all widgets.
 * @property {number} number
 * @property {string} command
 * @property {string} title Title of the command; "" without one.
 * @property {Readonly<Record<string, number | readonly number[]>>} places Its arguments with numbers.
 * @property {string} by
 * @property {boolean} isOurs
 * @property {number} since
 * @property {boolean} isLost
 *
 * @typedef {object} LogLine
 * @property {number} number Number of the line in its session.
 * @property {number} time Time of the line, in milliseconds since 1970.
 * @property {Line["level"]} level
 * @property {string} source
 * @property {string} text
 *
 * @typedef {object} Alert
 * @property {string} signal Name of the signal.
 * @property {string} title Title of the signal.
 * @property {Alarm} alarm
 * @property {string} text Displayed value.
 * @property {string} unit
 * @property {string} age Age of the value for people, such as "4 s"; "" while it is live.
 * @property {number} since Start of the alarm, in seconds on the page's clock.
 * @property {string} condition The exceeded limit, or the alarm state.
 * @property {"low" | "medium" | "high"} priority
 * @property {"unacknowledged" | "acknowledged" | "returned" | "shelved" | "suppressed"} state
 * @property {boolean} isActive Whether the value is abnormal.
 * @property {boolean} isKnown Whether the current value is known.
 * @property {number} raised Number of this alarm, for its acknowledgement.
 * @property {number} number Number of the activation; numbers increase in first-out order.
 * @property {number} times Number of activations.
 * @property {string} cause
 * @property {string} action Operator action.
 * @property {string} who Name of the operator who acknowledged or shelved it.
 * @property {number} leftS Time until shelving ends, in seconds.
 *
 * @typedef {object} StopState
 * @property {"" | "sending" | "sent" | "confirmed" | "latched" | "failed"} phase Progress of STOP:
 *   sent, latched by the server, accepted by the robot's transports. "" while the robot may be
 *   driven.
 * @property {boolean} isLatched
 * @property {boolean} isConfirmed
 * @property {string} by Name of the operator who pressed STOP.
 * @property {string} fault Reason why STOP cannot reach the robot now, or "".
 *
 * @typedef {object} Instance
 * @property {(readings: Readonly<Record<string, Reading>>, outputs: Readonly<Record<string, Outlet>>) => void} [update]
 *   Called in an animation frame after a change of any input or output, with all bound ones. A
 *   multiple input is an array of readings; see `many(readings.series)` in urc/kit.
 * @property {(size: {width: number, height: number}) => void} [resize] The cell's size in CSS pixels.
 * @property {() => void} [destroy]
 *
 * @typedef {object} WidgetModule
 * @property {{mount: (ctx: Context) => Instance | undefined | Promise<Instance | undefined>}} default
 */
export {};
