// @ts-check
/**
 * Makes the pages an app of the device: they open even where the server cannot be reached, and say
 * so. It needs HTTPS, or the machine itself; elsewhere the pages are what they are without it.
 */

/** The one script that may become a service worker. */
const WORKER = "/sw.js";

/** @returns {string} what `register` takes where the page's policy asks for trusted types */
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
