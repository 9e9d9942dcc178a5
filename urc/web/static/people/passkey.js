// @ts-check
/**
 * Sign-in with a passkey or an identity provider, and adding a passkey. Pages call these functions
 * after a press. Each function throws an error with a one-line message for people.
 */
import { ask } from "../core/api_client.js";
import { t } from "../core/words.js";

const ADDRESS = /^(?:\[.*\]|[0-9.]+)$/;

/**
 * Return the reason why this browser offers no passkeys on this page, in the user's language; "" if
 * it does.
 *
 * @returns {string}
 */
export function obstacle() {
  if (ADDRESS.test(location.hostname)) {
    return t("Browsers do not offer passkeys for an IP address. Open this page by its host name.");
  }
  if (!isSecureContext) return t("Browsers offer passkeys only over HTTPS.");
  if (!("PublicKeyCredential" in window)) return t("This browser does not support passkeys.");
  return "";
}

/**
 * Sign in with a passkey on this device.
 *
 * @returns {Promise<string>} name of the person
 */
export async function signInWithPasskey() {
  check();
  const options = await ask("/sign-in/passkey/options", {});
  const publicKey = { ...options, challenge: bytes(options.challenge), allowCredentials: [] };
  const made = await dialog(() => navigator.credentials.get({ publicKey }));
  const found = /** @type {AuthenticatorAssertionResponse} */ (made.response);
  const response = {
    clientDataJSON: text(found.clientDataJSON),
    authenticatorData: text(found.authenticatorData),
    signature: text(found.signature),
    userHandle: found.userHandle ? text(found.userHandle) : null,
  };
  return (await ask("/sign-in/passkey", { response: credential(made, response) })).name;
}

/**
 * Add a passkey on this device for the signed-in person.
 *
 * @param {string} name displayed name of the passkey
 * @returns {Promise<import("./types.js").Passkey>}
 */
export async function addPasskey(name) {
  check();
  const options = await ask("/account/passkeys/options", {});
  const publicKey = {
    ...options,
    challenge: bytes(options.challenge),
    user: { ...options.user, id: bytes(options.user.id) },
    excludeCredentials: options.excludeCredentials.map((/** @type {{ id: string }} */ one) => ({
      ...one,
      id: bytes(one.id),
    })),
  };
  const made = await dialog(() => navigator.credentials.create({ publicKey }));
  const found = /** @type {AuthenticatorAttestationResponse} */ (made.response);
  const response = {
    clientDataJSON: text(found.clientDataJSON),
    attestationObject: text(found.attestationObject),
  };
  return ask("/account/passkeys/add", { name, response: credential(made, response) });
}

/** @returns {Promise<import("./types.js").Passkey[]>} the passkeys of the signed-in person */
export async function ownPasskeys() {
  return (await ask("/account/passkeys")).passkeys;
}

/**
 * @param {string} id
 * @param {string} name
 * @returns {Promise<import("./types.js").Passkey[]>} the passkeys after the change
 */
export async function renamePasskey(id, name) {
  return (await ask("/account/passkeys/rename", { id, name })).passkeys;
}

/**
 * @param {string} id
 * @returns {Promise<import("./types.js").Passkey[]>} the passkeys after the change
 */
export async function removePasskey(id) {
  return (await ask("/account/passkeys/remove", { id })).passkeys;
}

/** Open the identity provider's page, which redirects back here. */
export async function signInWithProvider() {
  location.assign((await ask("/sign-in/oidc", {})).url);
}

function check() {
  const reason = obstacle();
  if (reason) throw new Error(reason);
}

/**
 * @param {() => Promise<Credential | null>} open
 * @returns {Promise<PublicKeyCredential>}
 */
async function dialog(open) {
  try {
    const made = await open();
    if (made instanceof PublicKeyCredential) return made;
  } catch (error) {
    const name = error instanceof DOMException ? error.name : "";
    if (name === "InvalidStateError") throw new Error(t("This device already has a passkey."));
    if (name === "SecurityError") throw new Error(t("The browser does not allow passkeys on this page."));
    if (name !== "NotAllowedError" && name !== "AbortError") throw error;
  }
  throw new Error(t("The passkey dialog was closed or timed out."));
}

/**
 * @param {PublicKeyCredential} made
 * @param {object} response
 */
function credential(made, response) {
  return { id: made.id, rawId: text(made.rawId), type: made.type, response };
}

/**
 * Return the bytes of a base64url text; older browsers have no method for this.
 *
 * @param {string} said
 */
function bytes(said) {
  const binary = atob(said.replaceAll("-", "+").replaceAll("_", "/"));
  return Uint8Array.from(binary, (one) => one.charCodeAt(0));
}

/** @param {ArrayBuffer} found */
function text(found) {
  const binary = Array.from(new Uint8Array(found), (one) => String.fromCharCode(one)).join("");
  return btoa(binary).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}
