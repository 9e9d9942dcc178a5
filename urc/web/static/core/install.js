// @ts-check
/**
 * Makes the pages an installed app, which opens with a message if the server is unavailable.
 * Installation needs HTTPS or localhost; elsewhere, the pages work without it.
 */

/** The only script that may become a service worker. */
const WORKER = "/sw.js";

/** @returns {string} the argument for `register` under a policy with trusted types */
function trusted() {
  const types = /** @type {any} */ (globalThis).trustedTypes;
  if (!types) return WORKER;
  return types.createPolicy("urc", { createScriptURL: () => WORKER }).createScriptURL("");
}

if (isSecureContext && "serviceWorker" in navigator) {
  navigator.serviceWorker.register(trusted(), { updateViaCache: "none" }).catch((error) => {
    console.info("URC: not kept for use without the server:", error);
  });
}
