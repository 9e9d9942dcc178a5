// @ts-check
/**
 * Questions to this server's own `/api/v1`, each with one answer, or one line that says why not.
 */
import { t } from "./words.js";

/** An answer may take as long as a robot is tried. */
const WITHIN_MS = 30_000;

/**
 * @param {string} path
 * @param {object | Blob} [body] sent as JSON, or as it is; without one it is only asked
 * @returns {Promise<any>}
 */
export async function ask(path, body) {
  /** @type {RequestInit} */
  const how = { cache: "no-store", signal: AbortSignal.timeout(WITHIN_MS) };
  if (body instanceof Blob) {
    Object.assign(how, { method: "POST", body, headers: { "content-type": "application/octet-stream" } });
  } else if (body) {
    const headers = { "content-type": "application/json" };
    Object.assign(how, { method: "POST", body: JSON.stringify(body), headers });
  }
  let answer;
  try {
    answer = await fetch(path, how);
  } catch {
    throw new Error(t("no connection to URC"));
  }
  const isJson = answer.headers.get("content-type")?.startsWith("application/json");
  const said = isJson ? await answer.json() : { error: (await answer.text()).trim().slice(0, 200) };
  if (!answer.ok) throw new Error(said.error || `HTTP ${answer.status}`);
  return said;
}

/** @param {unknown} error */
export function reason(error) {
  return error instanceof Error ? error.message : String(error);
}
