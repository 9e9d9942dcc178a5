// @ts-check
/**
 * The playground: a robot in a frame, and its file beside it. The robot's worker is the server of the
 * frame; another worker checks the file.
 */
import { Editor } from "./editor.js";
import { PythonWorker } from "./python_worker.js";
import { staticPage } from "./robot_html.js";
import { fragmentOf, textOf } from "./text_link.js";

/** Time limit of a request to the robot; the longest one loads a document. */
const WITHIN_MS = 30_000;
/** Pause between two attempts to replace a robot that is not at rest. */
const REST_MS = 300;
/** Pause before the files are kept, so that the first picture of the robot comes first. */
const KEEP_AFTER_MS = 3000;
const FIRST = "dash/robots/turtlebot4.yaml";
/** @type {Record<string, string>} */
const STEPS = { interpreter: "Loading Python…", code: "Loading URC…" };

/** @param {string} name */
function part(name) {
  const found = document.querySelector(name);
  if (!(found instanceof HTMLElement)) throw new Error(`the page lacks ${name}`);
  return found;
}

const state = part("[data-state]");
const main = part("#main");
const go = /** @type {HTMLButtonElement} */ (part("[data-go]"));
const worker = new PythonWorker((step) => tell(STEPS[step] ?? step));
const address = location.href.replace(/[?#].*/, "");
/** @type {HTMLIFrameElement | null} */
let frame = null;
/**
 * The first page of the robot, which the worker renders while the frame loads.
 *
 * @type {Promise<string> | null}
 */
let early = null;
/** The text of the shipped robot. */
let first = "";
/** The text of the running robot, and its name. */
let running = "";
let robot = "";
/** The newest text without errors. */
let wanted = "";
let isOpening = false;
/** What is said of all running robots. */
let note = "";
/** Whether this page is part of another page of the site, whose button loaded it. */
const isEmbedded = window.parent !== window && new URLSearchParams(location.search).has("embedded");

/** @param {string} text */
const tell = (text) => {
  state.textContent = text;
};

/** @param {object} said */
const ask = (said) => worker.ask({ do: "robot", ...said }, WITHIN_MS);

/** What the frame asks from its server. */
Object.assign(window, {
  urcPlayground: {
    /** @param {string} url @param {MessagePort} port */
    connect: (url, port) => void worker.ask({ do: "robot", verb: "connect", url, port }, WITHIN_MS, [port]),
    /** @param {string} method @param {string} url @param {string} body */
    ask: (method, url, body) => ask({ verb: "ask", method, url, body }),
    /** @param {string} query */
    page: async (query) => {
      const found = early && query === "" ? early : ask({ verb: "page", query });
      early = null;
      return staticPage(await found);
    },
  },
});

const editor = new Editor(part("[data-text]"), {
  text: "",
  label: "Robot file in YAML",
  page: address,
  onChecked(text, report) {
    if (report.errors || !frame || text === running) return;
    wanted = text;
    void reopen();
  },
});

async function begin() {
  const linked = await textOf(location.hash);
  if (linked !== null) editor.text = linked;
  else if (location.hash.length > 1) tell("This link holds no valid text; the page shows the TurtleBot.");
  if (!editor.text) editor.text = first = await shipped();
  part("[data-tabs]").hidden = false;
  if (linked !== null) {
    view("text");
    void editor.check();
  }
  if (isEmbedded) await start();
}

/** @returns {Promise<string>} the text of the shipped robot */
async function shipped() {
  const response = await fetch(new URL(FIRST, import.meta.url));
  if (!response.ok) throw new Error(`${response.url}: HTTP ${response.status}`);
  return response.text();
}

/**
 * Keep all files for later visits without a network, and tell when all are kept. Some browsers permit
 * no service worker, for example in private windows.
 */
async function keep() {
  if (!("serviceWorker" in navigator)) return;
  try {
    await navigator.serviceWorker.register(new URL("sw.js", import.meta.url));
    const { active } = await navigator.serviceWorker.ready;
    const { port1, port2 } = new MessageChannel();
    const told = new Promise((resolve) => port1.addEventListener("message", ({ data }) => resolve(data)));
    port1.start();
    active?.postMessage("keep", [port2]);
    const { isKept, reason } = await told;
    if (!isKept) throw new Error(reason);
    note = " This page also works offline.";
    tellRunning();
  } catch (error) {
    console.info("URC: the playground is not kept for use offline:", error);
  }
}

async function start() {
  go.disabled = true;
  go.textContent = "Starting…";
  try {
    await open(editor.text);
    early = ask({ verb: "page", query: "" });
    early.catch(() => {}); // reported to the frame
    frame = document.createElement("iframe");
    frame.title = "Dashboard of the robot";
    frame.src = new URL("frame.html", import.meta.url).href;
    part("[data-robot]").replaceChildren(frame);
    setTimeout(() => void keep(), KEEP_AFTER_MS);
  } catch (error) {
    tell(`The robot did not start: ${error instanceof Error ? error.message : error}`);
    go.disabled = false;
    go.textContent = "Start the robot";
  }
}

/**
 * Load a text as the robot.
 *
 * @param {string} text
 * @returns {Promise<boolean>} whether the robot was at rest, so that the text could replace it
 */
async function open(text) {
  const name = await ask({ verb: "open", text });
  if (!name) return false;
  robot = name;
  running = text;
  tellRunning();
  return true;
}

function tellRunning() {
  tell(`${robot} runs in this page. No real robot moves.${note}`);
}

/** Switch the robot to the newest valid text, and show its page. */
async function reopen() {
  if (isOpening) return;
  isOpening = true;
  try {
    while (frame && wanted !== running) {
      if (!(await open(wanted))) {
        tell("The new text waits until no one drives the robot.");
        await new Promise((done) => setTimeout(done, REST_MS));
        continue;
      }
      early = null;
      frame.contentWindow?.location.replace(new URL("frame.html", import.meta.url));
    }
  } catch (error) {
    tell(`Not applied: ${error instanceof Error ? error.message : error}`);
  } finally {
    isOpening = false;
  }
}

/** @param {string} name */
function view(name) {
  main.dataset["view"] = name;
  for (const button of document.querySelectorAll("[data-tabs] button")) {
    button.setAttribute("aria-pressed", String(button.getAttribute("data-view") === name));
  }
}

for (const button of document.querySelectorAll("[data-tabs] button")) {
  button.addEventListener("click", () => view(button.getAttribute("data-view") ?? "robot"));
}
if (isEmbedded) {
  document.documentElement.classList.add("play-embedded");
  const whole = /** @type {HTMLAnchorElement} */ (part("[data-whole]"));
  whole.hidden = false;
  whole.addEventListener("click", (event) => {
    if (editor.text === first) return;
    event.preventDefault();
    void fragmentOf(editor.text).then((fragment) => window.open(address + fragment, "_top"));
  });
}
go.addEventListener("click", () => void start());
addEventListener("hashchange", () => location.reload());
begin().catch((error) => tell(`The page did not load: ${error instanceof Error ? error.message : error}`));
