// @ts-check
/**
 * The service worker, which stores the last pages for times without a server.
 *
 * The server always takes precedence, so no old page is shown while it responds. Requests that move
 * or concern a robot (`/api`, `/ws`, and all methods except GET) bypass the service worker. It has
 * no timer and sends no command.
 */

/**
 * @typedef {Event & {waitUntil: (work: Promise<unknown>) => void}} LifeEvent
 * @typedef {LifeEvent & {request: Request, respondWith: (answer: Promise<Response>) => void}} AskEvent
 */

/** TypeScript's page types lack service workers. @type {{addEventListener: (name: string, listener: (event: any) => void) => void}} */
const worker = self;

const CACHE = "urc-1";
/** Files that are stored in addition to opened pages. */
const FIRST = ["/", "/static/core/tokens.css", "/static/core/app.css", "/static/core/device.css", "/static/manage/menu.css", "/static/manage/card.css", "/static/manage/fleet.css", "/static/core/theme.js", "/static/core/handedness.js", "/static/favicon.svg"];
const KEPT = /^\/(static|vendor|widgets|words)\/|^\/$|^\/robots\/[^/]+\/$|^\/app\.webmanifest$/;
/** Polled by the pages of a widget in development; useless without the server. */
const NEVER = /\/stamp$/;
const MOST = 400;

worker.addEventListener("install", (/** @type {LifeEvent} */ event) => {
  event.waitUntil(caches.open(CACHE).then((cache) => cache.addAll(FIRST)));
});

worker.addEventListener("activate", (/** @type {LifeEvent} */ event) => {
  event.waitUntil(
    caches
      .keys()
      .then((names) => Promise.all(names.filter((name) => name !== CACHE).map((name) => caches.delete(name)))),
  );
});

worker.addEventListener("fetch", (/** @type {AskEvent} */ event) => {
  const { request } = event;
  const url = new URL(request.url);
  if (request.method !== "GET" || url.origin !== location.origin) return;
  if (url.searchParams.has("key")) return; // URLs with a key are never stored
  if (!KEPT.test(url.pathname) || NEVER.test(url.pathname)) return;
  event.respondWith(answer(event, request));
});

/**
 * @param {AskEvent} event
 * @param {Request} request
 */
async function answer(event, request) {
  try {
    const found = await fetch(request);
    // A redirect's response belongs to another URL and cannot open a page.
    if (found.status === 200 && !found.redirected) event.waitUntil(keep(request, found.clone()));
    return found;
  } catch (error) {
    const old = await caches.match(request, { cacheName: CACHE });
    if (old) return old;
    if (request.mode === "navigate") {
      const menu = await caches.match("/", { cacheName: CACHE });
      if (menu) return menu;
    }
    throw error;
  }
}

/**
 * @param {Request} request
 * @param {Response} response
 */
async function keep(request, response) {
  const cache = await caches.open(CACHE);
  await cache.put(request, response);
  const names = await cache.keys(); // oldest first
  await Promise.all(names.slice(0, Math.max(0, names.length - MOST)).map((name) => cache.delete(name)));
}
