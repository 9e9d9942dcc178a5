// @ts-check
/**
 * The worker with Python. One worker checks documents, another runs the robot, so a check never
 * delays the robot.
 *
 * Messages in: `{id, do: "check", text}`, `{id, do: "report", folder, path, files}`, and those of
 * `playground/robot.py`. Messages out: `{id, value}` or `{id, fault}`, and `{progress}` while loading.
 */
import { unpack } from "./archive.js";
import { loadPyodide } from "./pyodide/pyodide.mjs";

const HOME = "/urc";
/** Pyodide's list of packages: none, because everything is in `python.bin`. */
const NO_PACKAGES = {
  info: { abi_version: "2026_0", arch: "wasm32", platform: "emscripten_5_0_3", python: "3.14.2", version: "0" },
  packages: {},
};

/** @param {string} step */
const tell = (step) => postMessage({ progress: step });

/** @returns {Promise<any>} the interpreter, with URC on its path */
async function started() {
  tell("interpreter");
  const root = new URL("./", import.meta.url);
  const archive = fetch(new URL("python.bin", root));
  archive.catch(() => {}); // reported below
  const python = await loadPyodide({
    indexURL: new URL("pyodide/", root).href,
    lockFileContents: /** @type {any} */ (NO_PACKAGES),
  });
  tell("code");
  await unpack(await archive, python.FS, HOME);
  python.runPython(`
import sys
sys.path.insert(0, "${HOME}")
from playground.stand_ins import install
install()
`);
  return python;
}

/** @type {Promise<any> | undefined} */
let python;
/** @type {Promise<any> | undefined} */
let checker;
/** @type {Promise<any> | undefined} */
let robot;

/** @type {Record<string, (said: any) => Promise<unknown>>} */
const WORK = {
  async check({ text }) {
    return JSON.parse((await checking()).check(text, "/check"));
  },
  async report({ folder, path, files }) {
    const given = (await python).toPy(files ?? {});
    return JSON.parse((await checking()).report(folder, path, given));
  },
  async robot(said) {
    robot ??= (python ??= started()).then((one) =>
      one.runPython("from pathlib import Path; from playground.robot import Playground; Playground(Path('/robot'))"),
    );
    const server = await robot;
    switch (said.verb) {
      case "open":
        return server.open(said.text);
      case "page":
        return server.page(said.query);
      case "connect":
        return connect(server, said.url, said.port);
      case "ask": {
        const found = await server.ask(said.method, said.url, said.body);
        const [status, text] = found.toJs();
        found.destroy();
        return { status, text };
      }
      default:
        throw new Error(`unknown request: ${said.verb}`);
    }
  },
};

/**
 * Connect a page's port to the robot, in place of a WebSocket.
 *
 * @param {any} server
 * @param {string} url
 * @param {MessagePort} port
 */
function connect(server, url, port) {
  const line = server.connect(url, {
    text: (/** @type {string} */ data) => port.postMessage(data),
    binary(/** @type {any} */ data) {
      const bytes = data.toJs();
      data.destroy?.();
      port.postMessage(bytes.buffer, [bytes.buffer]);
    },
    closed: (/** @type {number} */ code, /** @type {string} */ reason) => port.postMessage({ code, reason }),
  });
  port.addEventListener("message", ({ data }) => {
    if (typeof data === "string") line.take(data);
    else line.hang_up();
  });
  port.start();
  return true;
}

function checking() {
  checker ??= (python ??= started()).then((one) => one.pyimport("playground.checker"));
  return checker;
}

/**
 * The reason at the end of a Python traceback, without the traceback.
 *
 * @param {unknown} error
 */
function reason(error) {
  const text = (error instanceof Error ? error.message : String(error)).trim();
  const found = text.match(/^[\w.]*?(\w+): (.*)$/gm)?.at(-1) ?? text;
  return found.replace(/^(?:[\w.]+\.)?UrcError: /, "");
}

addEventListener("message", async ({ data }) => {
  try {
    python ??= started();
    const work = WORK[data.do];
    if (!work) throw new Error(`unknown request: ${data.do}`);
    postMessage({ id: data.id, value: await work(data) });
  } catch (error) {
    console.info("URC:", error);
    postMessage({ id: data.id, fault: reason(error) });
  }
});
