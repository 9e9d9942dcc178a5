// @ts-check
/**
 * What several hands on one command give together: each argument is of the hand that pushed it first.
 *
 * A hand that only touches a control, or has let it spring back, has no argument. One that pushes
 * what another hand has, gives nothing for it before it has been at rest: nothing jumps from one hand
 * to the other, neither when a second one comes nor when the first one goes.
 *
 * @typedef {import("../widgets/output.js").Output} Output
 * @typedef {import("../core/types.js").Value} Value
 *
 * @typedef {object} Giving A grip, as far as it matters here.
 * @property {Pick<Output, "neutral" | "ranges">} output
 * @property {() => Record<string, Value>} given What its hand gives, by the command's own names.
 */

/** @type {ReadonlySet<string>} */
const NONE = new Set();

export class Together {
  constructor() {
    /** Argument → who has it. @type {Map<string, Giving>} */
    this.owners = new Map();
    /** Arguments that a hand pushes and does not have. @type {Map<Giving, Set<string>>} */
    this.waiting = new Map();
  }

  /**
   * Return the arguments of the command.
   *
   * @param {ReadonlySet<Giving>} grips that are held, in the order in which they were taken
   * @returns {Record<string, Value>}
   */
  values(grips) {
    this.forget(grips);
    const all = [...grips].flatMap((grip) => {
      return Object.entries(grip.given()).map(([name, value]) => ({ grip, name, value }));
    });
    const resting = all.filter(isAtRest);
    for (const { grip, name } of resting) this.rest(grip, name);
    const pushed = all.filter((one) => !isAtRest(one) && this.isHad(one.grip, one.name));
    const neutral = [...grips].map(({ output }) => output.neutral);
    const given = [...resting, ...pushed].map(({ name, value }) => [name, value]);
    return Object.assign({}, ...neutral, Object.fromEntries(given));
  }

  /**
   * Return the arguments that a hand pushes and does not have.
   *
   * @param {Giving} grip
   */
  lost(grip) {
    return this.waiting.get(grip) ?? NONE;
  }

  /** Let go of what hands had that are gone. @param {ReadonlySet<Giving>} grips */
  forget(grips) {
    for (const [name, owner] of this.owners) if (!grips.has(owner)) this.owners.delete(name);
    for (const grip of this.waiting.keys()) if (!grips.has(grip)) this.waiting.delete(grip);
  }

  /**
   * @param {Giving} grip
   * @param {string} name
   */
  rest(grip, name) {
    if (this.owners.get(name) === grip) this.owners.delete(name);
    this.waiting.get(grip)?.delete(name);
  }

  /**
   * Whether a hand that pushes an argument has it, now at the latest.
   *
   * @param {Giving} grip
   * @param {string} name
   */
  isHad(grip, name) {
    if (!this.owners.has(name) && !this.lost(grip).has(name)) this.owners.set(name, grip);
    if (this.owners.get(name) === grip) return true;
    this.waiting.set(grip, new Set([...this.lost(grip), name]));
    return false;
  }
}

/** @param {{grip: Giving, name: string, value: Value}} given */
function isAtRest({ grip: { output }, name, value }) {
  const { neutral, ranges } = output;
  return value === (Object.hasOwn(neutral, name) ? neutral[name] : (ranges?.[name]?.rest ?? 0));
}
