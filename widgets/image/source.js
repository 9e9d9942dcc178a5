// @ts-check
/**
 * Which pictures a profile may hold. Pure.
 */

const PICTURE = /^data:image\/(png|jpeg|webp|gif|avif|svg\+xml)[;,]/i;

/**
 * Return the address of the picture, or "" when the options name none that a page may show.
 *
 * @param {{file?: unknown, source?: unknown}} options `file` is an address of this server
 */
export function pictureOf({ file, source }) {
  if (typeof file === "string" && file.startsWith("/") && !file.startsWith("//")) return file;
  return typeof source === "string" && PICTURE.test(source) ? source : "";
}
