// @ts-check
/**
 * Checks of documents: one worker for all editors of a page, loaded at the first check.
 *
 * @typedef {object} Problem
 * @property {number} line 1-based
 * @property {number} column 1-based
 * @property {number} [end_column]
 * @property {string} severity
 * @property {string} code
 * @property {string} message
 * @property {string} [hint]
 * @typedef {{errors: number, warnings: number, more_may_follow: boolean,
 *   tests: {run: number, failed: number}, problems: Problem[], fault?: string}} Report
 */
import { PythonWorker } from "./python_worker.js";

/** Time limit of a check; longer documents than any known one take a fraction of it. */
const WITHIN_MS = 30_000;

/** @type {Record<string, string>} */
const STEPS = { interpreter: "Loading Python…", code: "Loading URC…" };
/** @type {Set<(text: string) => void>} */
const listeners = new Set();

const worker = new PythonWorker((step) => {
  for (const tell of listeners) tell(STEPS[step] ?? step);
});

/**
 * @param {string} text
 * @param {(text: string) => void} [tell] shows the progress of loading
 * @returns {Promise<Report>}
 */
export async function check(text, tell = () => {}) {
  listeners.add(tell);
  try {
    const report = await worker.ask({ do: "check", text }, WITHIN_MS);
    if (report.fault) throw new Error(report.fault);
    return report;
  } finally {
    listeners.delete(tell);
  }
}

/**
 * Check a document of several files; the tests of the playground compare the result with the command.
 *
 * @param {string} folder working directory
 * @param {string} path the document
 * @param {Record<string, Uint8Array>} [files] files to write first
 * @returns {Promise<Report>}
 */
export function report(folder, path, files) {
  return worker.ask({ do: "report", folder, path, files }, WITHIN_MS);
}

/** @param {Report} found */
export function summary(found) {
  const words = [many(found.errors, "error"), many(found.warnings, "warning")];
  if (found.tests.run) words.push(`${found.tests.run - found.tests.failed} of ${many(found.tests.run, "test")} passed`);
  return words.join(", ") + (found.more_may_follow ? "; more checks run after the errors are corrected" : "");
}

/**
 * @param {number} number
 * @param {string} noun
 */
function many(number, noun) {
  return `${number} ${noun}${number === 1 ? "" : "s"}`;
}
