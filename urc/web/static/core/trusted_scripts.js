// @ts-check
/**
 * The scripts that run outside the page: the service worker, and the workers that receive images and decode
 * videos. Under the page's policy, only URLs from this module may start a worker. A policy can be created only
 * once a page.
 */

/** URL of each script. */
const SCRIPTS = {
  service: "/sw.js",
  pictures: new URL("../live/picture_worker.js", import.meta.url).href,
  video: new URL("../live/video_worker.js", import.meta.url).href,
};

const types = /** @type {any} */ (globalThis).trustedTypes;
const policy = types?.createPolicy("urc", {
  createScriptURL: (/** @type {"service" | "pictures" | "video"} */ name) => SCRIPTS[name] ?? "about:blank",
});

/**
 * Return the argument for `register` or `new Worker`.
 *
 * @param {"service" | "pictures" | "video"} name
 * @returns {string}
 */
export function scriptUrl(name) {
  return policy ? policy.createScriptURL(name) : SCRIPTS[name];
}
