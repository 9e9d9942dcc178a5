// @ts-check
/**
 * Lets Node find what a page finds by its import map: `node --import ./tests/js/page.mjs …`.
 */
import { register } from "node:module";

const STATIC = new URL("../../urc/web/static/", import.meta.url).href;

// Without a package.json that says so, Node takes a page's modules for scripts of its own kind.
const hooks = `
const STATIC = ${JSON.stringify(STATIC)};
const OURS = /^urc\\/([a-z_]+)$/;
export async function resolve(name, context, next) {
  const ours = OURS.exec(name)?.[1];
  // English is the key of every text, so nothing has to be said for it.
  const url = ours && new URL((ours === "words" ? "core/english" : "widgets/" + ours) + ".js", STATIC).href;
  const found = url ? { url, shortCircuit: true } : await next(name, context);
  return found.url.endsWith(".js") && !found.url.includes("/node_modules/")
    ? { ...found, format: "module" }
    : found;
}
`;
register(`data:text/javascript,${encodeURIComponent(hooks)}`);
