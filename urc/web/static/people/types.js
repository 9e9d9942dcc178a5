// @ts-check
/**
 * Shapes of the replies about people.
 *
 * @typedef {object} Passkey
 * @property {string} id
 * @property {string} name
 * @property {string} host host name at which browsers offer the passkey
 * @property {number} created_at UTC time in seconds since 1970
 * @property {number | null} used_at UTC time of the last sign-in; null before the first
 */
export {};
