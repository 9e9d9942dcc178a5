// @ts-check
/**
 * The differences between the driver's topics and those of a ROS robot, as notes. ROS reports none
 * of them: a command on a topic without subscribers simply has no effect. The notes block nothing.
 *
 * @typedef {import("../core/types.js").TopicMismatch} TopicMismatch
 */
import { t } from "../core/words.js";

/** The notes of one robot. */
export class TopicNotes {
  constructor() {
    /** Command → its note. @type {Map<string, string>} */
    this.commands = new Map();
    /** Signal → its note. @type {Map<string, string>} */
    this.signals = new Map();
  }

  /** @param {TopicMismatch[]} mismatches all mismatches */
  take(mismatches) {
    this.commands.clear();
    this.signals.clear();
    for (const one of mismatches) {
      const note = noteOf(one);
      for (const name of one.commands ?? []) this.commands.set(name, note);
      for (const name of one.signals ?? []) this.signals.set(name, note);
    }
  }
}

/**
 * Return a mismatch as a note. Types are named without their package, unless only the packages
 * differ, because a note has little room.
 *
 * @param {TopicMismatch} mismatch
 */
function noteOf({ code, topic, found: theirs = "", wanted: ours = "" }) {
  const isClear = bare(theirs) !== bare(ours);
  const [found, wanted] = isClear ? [bare(theirs), bare(ours)] : [theirs, ours];
  switch (code) {
    case "no-subscriber":
      return t("Nothing subscribes to {topic}", { topic });
    case "no-publisher":
      return t("Nothing publishes {topic}", { topic });
    case "takes-type":
      return t("{topic} takes {found}, not {wanted}", { topic, found, wanted });
    case "carries-type":
      return t("{topic} carries {found}, not {wanted}", { topic, found, wanted });
    case "ros-version":
      return t("This is ROS {found}, not ROS {wanted}", { found, wanted });
    default:
      return `${topic}: ${code}`;
  }
}

/** @param {string} type */
function bare(type) {
  return type.slice(type.lastIndexOf("/") + 1);
}
