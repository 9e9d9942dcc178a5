// @ts-check
/**
 * The service worker of the playground: it keeps the files of one version, and answers from them.
 *
 * The build writes the version into this file, so a browser notices every other version.
 */

/**
 * @typedef {Event & {waitUntil: (work: Promise<unknown>) => void}} LifeEvent
 * @typedef {LifeEvent & {request: Request, respondWith: (answer: Promise<Response>) => void}} AskEvent
 * @typedef {LifeEvent & {data: unknown}} SaidEvent
 */

/** TypeScript's page types lack service workers. @type {any} */
const worker = self;
const PREFIX = "urc-playground-";
const CACHE = `${PREFIX}VERSION`;

worker.addEventListener("install", () => worker.skipWaiting());

worker.addEventListener("activate", (/** @type {LifeEvent} */ event) => {
  event.waitUntil(
    (async () => {
      const names = await caches.keys();
      const old = names.filter((name) => name.startsWith(PREFIX) && name !== CACHE);
      await Promise.all(old.map((name) => caches.delete(name)));
      await worker.clients.claim();
    })(),
  );
});

worker.addEventListener("message", (/** @type {SaidEvent} */ event) => {
  if (event.data === "keep all") event.waitUntil(keepAll());
});

worker.addEventListener("fetch", (/** @type {AskEvent} */ event) => {
  const { request } = event;
  if (request.method !== "GET" || !request.url.startsWith(worker.registration.scope)) return;
  event.respondWith(answer(event, request));
});

/**
 * @param {AskEvent} event
 * @param {Request} request
 */
async function answer(event, request) {
  const cache = await caches.open(CACHE);
  const old = await cache.match(request, { ignoreSearch: true });
  if (old) return old;
  const found = await fetch(request);
  if (found.ok && !found.redirected) event.waitUntil(cache.put(request, found.clone()));
  return found;
}

/** Fetch the files that no page has needed yet. */
async function keepAll() {
  const cache = await caches.open(CACHE);
  const list = new URL("files.json", worker.registration.scope);
  const { files } = await (await fetch(list)).json();
  const urls = ["", ...files].map((file) => new URL(file, worker.registration.scope).href);
  for (const url of urls) {
    if (!(await cache.match(url))) await cache.add(url);
  }
}
