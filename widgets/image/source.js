// @ts-check
/**
 * Allowed images of a profile. Pure.
 */

const PICTURE = /^data:image\/(png|jpeg|webp|gif|avif|svg\+xml)[;,]/i;

/**
 * Return the URL of the image, or "" if the options contain no image that a page may show.
 *
 * @param {{file?: unknown, source?: unknown}} options `file` is a URL of this server
 */
export function pictureOf({ file, source }) {
  if (typeof file === "string" && file.startsWith("/") && !file.startsWith("//")) return file;
  return typeof source === "string" && PICTURE.test(source) ? source : "";
}
