// @ts-check
/**
 * Live pictures on the cards of the menu. Only cards that are seen are asked about, one after the
 * other and each at most twice a second, so that thirty cards cost the server no more than eight.
 */

const EVERY_MS = 500;
/** A robot of which nothing is known is asked about again after this time. */
const QUIET_MS = 5000;
/** The least time between two questions: eight a second on the whole page. */
const PACE_MS = 125;

/**
 * @typedef {object} Look
 * @property {HTMLElement} el
 * @property {string} url
 * @property {boolean} isSeen
 * @property {number} dueMs
 * @property {string} shown object URL of the picture
 */

/** @type {Look[]} */
const looks = [...document.querySelectorAll("[data-look]")].flatMap((el) =>
  el instanceof HTMLElement
    ? [{ el, url: el.dataset["look"] ?? "", isSeen: false, dueMs: 0, shown: "" }]
    : [],
);
const sight = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    const look = looks.find(({ el }) => el === target);
    if (look) look.isSeen = isIntersecting;
  }
});
for (const { el } of looks) sight.observe(el);

void go();

async function go() {
  for (;;) {
    const nowMs = performance.now();
    // The card is asked about whose turn is longest over; nothing of a page that nobody sees.
    const due = looks.filter((look) => isWanted(look) && look.dueMs <= nowMs);
    const next = due.sort((one, other) => one.dueMs - other.dueMs)[0];
    if (next && !document.hidden) {
      next.dueMs = nowMs + EVERY_MS;
      await renew(next);
    }
    await new Promise((resolve) => setTimeout(resolve, PACE_MS));
  }
}

/** @param {Look} look */
function isWanted({ el, isSeen }) {
  return isSeen || el.hidden; // what shows nothing yet is nowhere to be seen
}

/** @param {Look} look */
async function renew(look) {
  try {
    const answer = await fetch(look.url, { signal: AbortSignal.timeout(QUIET_MS) });
    if (answer.status !== 200) {
      look.el.hidden = true;
      look.dueMs += QUIET_MS;
    } else if (answer.headers.get("content-type")?.startsWith("image/")) {
      await show(look, await answer.blob());
    } else {
      list(look, await answer.json());
    }
  } catch {
    look.dueMs += QUIET_MS; // the server is away, or the picture is none: the last one stays
  }
}

/**
 * @param {Look} look
 * @param {Blob} picture
 */
async function show(look, picture) {
  const image = look.el.querySelector("img");
  if (!image) return;
  const [url, old] = [URL.createObjectURL(picture), look.shown];
  look.shown = url;
  image.src = url;
  await image.decode().finally(() => URL.revokeObjectURL(old));
  look.el.dataset["shows"] = "picture";
  image.hidden = look.el.hidden = false;
}

/**
 * @param {Look} look
 * @param {[string, string][]} values
 */
function list(look, values) {
  const el = look.el.querySelector("dl");
  if (!el) return;
  el.replaceChildren(
    ...values.flatMap(([title, text]) => {
      const [term, value] = [document.createElement("dt"), document.createElement("dd")];
      term.textContent = title;
      value.textContent = text;
      return [term, value];
    }),
  );
  look.el.dataset["shows"] = "values";
  el.hidden = look.el.hidden = values.length === 0;
}
