// @ts-check
/** Files that a document names for a foreign widget: the page hands over those, and no others. */
import assert from "node:assert/strict";
import { test } from "node:test";
import { filesOf } from "../../urc/web/static/frame/frame_files.js";

/** @type {string[]} */
const asked = [];
globalThis.fetch = /** @type {any} */ (
  async (/** @type {string} */ url) => {
    asked.push(url);
    if (url.endsWith("gone.png")) return { ok: false, status: 404 };
    const size = url.endsWith("huge.bin") ? 17 << 20 : 3;
    return { ok: true, blob: async () => ({ size, url }) };
  }
);

test("only addresses of a robot's files are asked for, each once", async () => {
  const found = await filesOf(
    {
      picture: "/robots/r/files/a1/face.png",
      list: ["/robots/r/files/a1/face.png", "/robots/r/files/b2/gone.png", 5],
      text: "/healthz",
      other: "https://example.org/robots/r/files/a1/face.png",
      up: "/robots/r/../files/x",
      out: "/robots/r/files/../../../healthz",
      hidden: "/robots/r/files/%2e%2e/%2E%2e/settings",
      asking: "/robots/r/files/a?b",
      number: 1,
      nothing: null,
    },
    new AbortController().signal,
  );
  assert.deepEqual(asked, ["/robots/r/files/a1/face.png", "/robots/r/files/b2/gone.png"]);
  assert.deepEqual(Object.keys(found), ["/robots/r/files/a1/face.png"]);
});

test("what is too large is left out", async () => {
  const found = await filesOf({ file: "/robots/r/files/a1/huge.bin" }, new AbortController().signal);
  assert.deepEqual(found, {});
});
