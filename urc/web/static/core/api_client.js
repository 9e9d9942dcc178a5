// @ts-check
/**
 * Requests to this server's `/api/v1`, each with one reply or a one-line reason.
 */
import { request } from "./server.js";
import { t } from "./words.js";

/** Time limit of a request, long enough for the test of a robot. */
const WITHIN_MS = 30_000;

/**
 * @param {string} path
 * @param {object | Blob} [body] JSON or raw body of a POST; without it the request is a GET
 * @param {RequestInit} [more] further options, such as another time limit
 * @returns {Promise<any>}
 */
export async function ask(path, body, more = {}) {
  /** @type {RequestInit} */
  const how = { cache: "no-store", signal: AbortSignal.timeout(WITHIN_MS), ...more };
  if (body instanceof Blob) {
    Object.assign(how, { method: "POST", body, headers: { "content-type": "application/octet-stream" } });
  } else if (body) {
    const headers = { "content-type": "application/json" };
    Object.assign(how, { method: "POST", body: JSON.stringify(body), headers });
  }
  let answer;
  try {
    answer = await request(path, how);
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
