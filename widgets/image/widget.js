// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { attribute, faultOf, noteOf, part, write } from "urc/kit";
import { Sheet } from "urc/offscreen_canvas";
import { pictureOf } from "./source.js";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, t } = ctx;
    const root = part(el, ".image");
    const place = part(el, ".image-place");
    const note = part(el, ".image-note");
    const words = String(options["words"] || part(el, ".image-title").textContent);
    const canvas = document.createElement("canvas");
    const sheet = new Sheet(canvas);
    canvas.className = "image-picture";
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", words);
    let fault = "";
    let said = "";
    const tell = () => write(note, [fault, said].filter(Boolean).join(" · "));
    const fail = (/** @type {string} */ problem) => {
      fault = problem;
      tell();
    };
    if (options["file"] || options["source"]) {
      still(ctx, root, place, words, fail);
    }

    ctx.picture("picture", (bitmap) => {
      // The canvas keeps the size of the image; the style sheet fits it into the cell.
      sheet.resize(bitmap.width, bitmap.height);
      sheet.pen.drawImage(bitmap, 0, 0);
      sheet.show();
      if (canvas.parentElement !== place) place.replaceChildren(canvas);
      fail("");
    }, (blob) => fail(faultOf(blob, t)));

    return {
      update({ picture }) {
        if (!picture) return;
        attribute(root, "data-state", picture.state);
        const isNone = picture.state === "none";
        said = isNone ? t("no picture yet") : noteOf(picture, t);
        tell();
        // An old image must not look current.
        canvas.hidden = picture.state === "gone";
        attribute(root, "data-gone", canvas.hidden ? "yes" : null);
      },
    };
  },
};

/**
 * Show the image of the profile.
 *
 * @param {Context} ctx
 * @param {HTMLElement} root
 * @param {HTMLElement} place
 * @param {string} words
 * @param {(fault: string) => void} fail
 */
function still({ options, t }, root, place, words, fail) {
  const source = pictureOf(options);
  const image = document.createElement("img");
  image.className = "image-picture";
  image.alt = words;
  image.addEventListener("error", () => fail(t("◆ the picture cannot be read")));
  image.addEventListener("load", () => {
    place.replaceChildren(image);
    if (root.dataset["state"] === "none") root.dataset["state"] = "live";
  });
  if (source) image.src = source;
  else fail(t("◆ the options contain no picture"));
}
