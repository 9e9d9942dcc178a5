// @ts-check
/**
 * Live images on the cards of the menu. Only visible cards are polled, one after the other and each at
 * most twice a second, so that thirty cards cost the server no more than eight.
 */

const EVERY_MS = 500;
/** Interval for polling a robot without data. */
const QUIET_MS = 5000;
/** Shortest interval of two requests: eight a second on the whole page. */
const PACE_MS = 125;

/**
 * @typedef {object} Look
 * @property {HTMLElement} el
 * @property {string} url
 * @property {boolean} isSeen
 * @property {number} dueMs
 * @property {string} shown object URL of the image
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
    // The card with the oldest due time is next; a hidden page polls none.
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
  return isSeen || el.hidden; // a card without content has no visible area
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
    look.dueMs += QUIET_MS; // the server is away, or the image is invalid: the last one stays
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
