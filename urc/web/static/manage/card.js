// @ts-check
/**
 * Live images on the cards of the menu. Only visible cards, and those that a short scroll shows, are
 * polled, one after the other and each at most twice a second. So thirty cards cause no more load on
 * the server than eight.
 */

const EVERY_MS = 500;
/** Interval for polling a robot without data. */
const QUIET_MS = 5000;
/**
 * Minimum interval between two requests, for eight requests per second on the whole page. Only the
 * first image of a card follows the one before without a pause.
 */
const PACE_MS = 125;
/** Margin of the screen in which cards count as visible, so that a scroll shows no empty card. */
const NEAR = "50%";

/**
 * @typedef {object} Look
 * @property {HTMLElement} el
 * @property {string} url
 * @property {boolean} isSeen
 * @property {number} dueMs 0 before the first request
 * @property {string} shown object URL of the image
 */

/** Watch the images of all cards on the page. */
export function watchPictures() {
  /** @type {Look[]} */
  const looks = [...document.querySelectorAll("[data-look]")].flatMap((el) =>
    el instanceof HTMLElement
      ? [{ el, url: el.dataset["look"] ?? "", isSeen: false, dueMs: 0, shown: "" }]
      : [],
  );
  const take = (/** @type {IntersectionObserverEntry[]} */ entries) => {
    for (const { target, isIntersecting } of entries) {
      const look = looks.find(({ el }) => el === target);
      if (look) look.isSeen = isIntersecting;
    }
  };
  const sight = new IntersectionObserver(take, { rootMargin: `${NEAR} 0px` });
  for (const { el } of looks) sight.observe(el);
  void go(looks);
}

/** @param {Look[]} looks */
async function go(looks) {
  for (;;) {
    const nowMs = performance.now();
    // The card with the oldest due time is next; hidden pages poll no cards.
    const due = looks.filter((look) => look.isSeen && look.dueMs <= nowMs);
    const next = due.sort((one, other) => one.dueMs - other.dueMs)[0];
    const isFirst = next?.dueMs === 0;
    if (next && !document.hidden) {
      next.dueMs = nowMs + EVERY_MS;
      await renew(next);
      if (isFirst) continue;
    }
    await new Promise((resolve) => setTimeout(resolve, PACE_MS));
  }
}

/** @param {Look} look */
async function renew(look) {
  try {
    const answer = await fetch(look.url, { signal: AbortSignal.timeout(QUIET_MS) });
    const isOld = answer.headers.get("x-urc-old") !== null;
    const isPicture = answer.headers.get("x-urc-picture") !== null;
    look.el.dataset["old"] = String(isOld);
    if (answer.status !== 200 || isOld || isPicture) look.dueMs += QUIET_MS;
    if (answer.status !== 200) look.el.dataset["shows"] = "";
    else if (answer.headers.get("content-type")?.startsWith("image/")) await show(look, await answer.blob());
    else list(look, await answer.json());
  } catch {
    look.el.dataset["shows"] ??= "";
    look.dueMs += QUIET_MS; // without a server or with an invalid image, the last image stays
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
  image.toggleAttribute("data-drawing", picture.type.startsWith("image/svg"));
  await image.decode().finally(() => URL.revokeObjectURL(old));
  look.el.dataset["shows"] = "picture";
  image.hidden = false;
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
  look.el.dataset["shows"] = values.length > 0 ? "values" : "";
  el.hidden = values.length === 0;
}
