// @ts-check
/**
 * The service worker of the playground: it keeps all files of one version, and answers from them.
 *
 * Either all files of this version are kept, or requests go to the server: a page never gets files of
 * two versions. A new version that follows a kept one is kept before it replaces the old one, which
 * happens when no page uses the old one any more.
 */

/**
 * @typedef {Event & {waitUntil: (work: Promise<unknown>) => void}} LifeEvent
 * @typedef {LifeEvent & {request: Request, respondWith: (answer: Promise<Response>) => void}} AskEvent
 * @typedef {LifeEvent & {data: unknown, ports: readonly MessagePort[]}} SaidEvent
 */

/**
 * The build writes this line, so a browser notices every other version: SHA-256 of each file.
 *
 * @type {{version: string, files: Record<string, string>}}
 */
const BUILD = { version: "", files: {} };

/** TypeScript's page types lack service workers. @type {any} */
const worker = self;
/** @type {string} */
const SCOPE = worker.registration.scope;
/** One origin may have several playgrounds, and all share its caches. */
const PREFIX = `urc-playground ${SCOPE} `;
const CACHE = PREFIX + BUILD.version;
/** An entry that is written last, once a cache has all files. */
const WHOLE = new URL("whole", SCOPE).href;
const AT_ONCE = 4;

let isWhole = false;
/** @type {Promise<void> | undefined} */
let keeping;

worker.addEventListener("install", (/** @type {LifeEvent} */ event) => event.waitUntil(install()));
worker.addEventListener("activate", (/** @type {LifeEvent} */ event) => event.waitUntil(activate()));

worker.addEventListener("message", (/** @type {SaidEvent} */ event) => {
  if (event.data !== "keep") return;
  const told = keep().then(
    () => ({ isKept: true }),
    (error) => ({ isKept: false, reason: String(error) }),
  );
  event.waitUntil(told.then((found) => event.ports[0]?.postMessage(found)));
});

worker.addEventListener("fetch", (/** @type {AskEvent} */ event) => {
  const { request } = event;
  const name = nameOf(request.url);
  if (request.method === "GET" && Object.hasOwn(BUILD.files, name)) event.respondWith(answer(request, name));
});

async function install() {
  const old = await oldCaches();
  const kept = await Promise.all(old.map(async (name) => (await caches.open(name)).match(WHOLE)));
  if (kept.some(Boolean)) await keep();
  else await worker.skipWaiting();
}

async function activate() {
  await Promise.all((await oldCaches()).map((name) => caches.delete(name)));
  await worker.clients.claim();
}

async function oldCaches() {
  return (await caches.keys()).filter((name) => name.startsWith(PREFIX) && name !== CACHE);
}

/** @param {string} url */
function nameOf(url) {
  const { origin, pathname } = new URL(url);
  const path = origin + pathname;
  if (!path.startsWith(SCOPE)) return "";
  return path.slice(SCOPE.length) || "index.html";
}

/** @param {string} name */
function addressOf(name) {
  return new URL(name, SCOPE).href;
}

/**
 * @param {Request} request
 * @param {string} name
 */
async function answer(request, name) {
  const cache = await caches.open(CACHE);
  isWhole ||= (await cache.match(WHOLE)) !== undefined;
  const kept = isWhole ? await cache.match(addressOf(name)) : undefined;
  return kept ?? fetch(request);
}

/** Keep all files that are not kept yet; reject if a file is not of this version. */
function keep() {
  keeping ??= keepAll().finally(() => {
    keeping = undefined;
  });
  return keeping;
}

async function keepAll() {
  const cache = await caches.open(CACHE);
  if (await cache.match(WHOLE)) return;
  const old = await Promise.all((await oldCaches()).map((name) => caches.open(name)));
  const names = Object.keys(BUILD.files);
  const next = async () => {
    for (let name = names.pop(); name !== undefined; name = names.pop()) {
      const url = addressOf(name);
      if (!(await cache.match(url))) await cache.put(url, await found(name, old));
    }
  };
  await Promise.all(Array.from({ length: AT_ONCE }, next));
  await cache.put(WHOLE, new Response(BUILD.version));
}

/**
 * Return a file of this version: from an older cache, or from the server.
 *
 * @param {string} name
 * @param {Cache[]} old
 */
async function found(name, old) {
  const url = addressOf(name);
  for (const cache of old) {
    const checked = await ofThisVersion(name, await cache.match(url));
    if (checked) return checked;
  }
  for (const how of /** @type {const} */ (["default", "reload"])) {
    const checked = await ofThisVersion(name, await fetch(url, { cache: how }));
    if (checked) return checked;
  }
  throw new Error(`${url}: the server has another version of this file`);
}

/**
 * Return a new response, because the answer to a redirected request would not open a page.
 *
 * @param {string} name
 * @param {Response | undefined} response
 */
async function ofThisVersion(name, response) {
  if (!response?.ok) return undefined;
  const data = await response.arrayBuffer();
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", data));
  const text = Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
  if (text !== BUILD.files[name]) return undefined;
  return new Response(data, { headers: { "content-type": response.headers.get("content-type") ?? "" } });
}
