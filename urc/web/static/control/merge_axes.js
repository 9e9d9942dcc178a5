// @ts-check
/**
 * The merged arguments of several inputs for one command. Each argument belongs to the first input
 * that moved it.
 *
 * An input at rest has no argument. An input that moves another input's argument must first return
 * to rest. A value therefore never jumps between inputs when a second one begins or the first one
 * ends.
 *
 * @typedef {import("../widgets/output.js").Output} Output
 * @typedef {import("../core/types.js").Value} Value
 *
 * @typedef {object} Giving The interface of a held control for merging.
 * @property {Pick<Output, "neutral" | "ranges">} output
 * @property {() => Record<string, Value>} given Its sampled values, by the names of the command.
 */

/** @type {ReadonlySet<string>} */
const NONE = new Set();

export class MergedAxes {
  constructor() {
    /** Argument → its owner. @type {Map<string, Giving>} */
    this.owners = new Map();
    /** Arguments that an input moves but does not own. @type {Map<Giving, Set<string>>} */
    this.waiting = new Map();
  }

  /**
   * Return the arguments of the command.
   *
   * @param {ReadonlySet<Giving>} grips held controls, in the order of their start
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
   * Return the arguments that an input moves but does not own.
   *
   * @param {Giving} grip
   */
  lost(grip) {
    return this.waiting.get(grip) ?? NONE;
  }

  /** Release the arguments of ended inputs. @param {ReadonlySet<Giving>} grips */
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
   * Whether an input owns an argument that it moves; it becomes the owner of a free argument.
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
