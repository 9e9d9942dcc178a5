// @ts-check
/**
 * Makes the pages an installed app, which opens with a message if the server is unavailable.
 * Installation needs HTTPS or localhost; elsewhere, the pages work without it.
 */

import { scriptUrl } from "./trusted_scripts.js";

if (isSecureContext && "serviceWorker" in navigator) {
  navigator.serviceWorker.register(scriptUrl("service"), { updateViaCache: "none" }).catch((error) => {
    console.info("URC: not kept for use without the server:", error);
  });
}
