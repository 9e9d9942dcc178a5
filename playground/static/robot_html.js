// @ts-check
/**
 * The HTML of a robot's page, with the addresses of static files in place of those of a server.
 */

const DASH = new URL("dash/", import.meta.url).pathname;
const FOLDERS = ["static", "vendor", "widgets"];
/** Parts of the page that only a server can offer: the way back to its menu, and an installed app. */
const NO_SERVER = "<style>[data-back],[data-fullscreen]{display:none!important}</style>";

/** @param {string} html */
export function staticPage(html) {
  let found = html
    .replace(/<script[^>]*\/core\/install\.js[^>]*><\/script>/, "")
    .replace(/<script[^>]*\/control\/early_stop\.js[^>]*><\/script>/, "")
    .replace(/<link rel="(?:manifest|apple-touch-icon)"[^>]*>/g, "")
    .replace("</head>", `${NO_SERVER}</head>`);
  for (const folder of FOLDERS) {
    for (const quote of ['"', "&#34;", "&quot;"]) {
      found = found.replaceAll(`${quote}/${folder}/`, `${quote}${DASH}${folder}/`);
    }
  }
  // Last, because its new entries begin with the addresses of a server.
  return found.replace(
    /(<script[^>]*type="importmap"[^>]*>)(.*?)(<\/script>)/s,
    (_, head, map, end) => head + mapped(map) + end,
  );
}

/** @param {string} text the import map, with the addresses of static files */
function mapped(text) {
  const map = JSON.parse(text);
  for (const folder of FOLDERS) map.imports[`/${folder}/`] = `${DASH}${folder}/`;
  map.imports[`${DASH}static/core/server.js`] = new URL("port_server.js", import.meta.url).pathname;
  return JSON.stringify(map).replaceAll("<", "\\u003c");
}
