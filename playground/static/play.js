// @ts-check
/**
 * The playground: a robot in a frame, and its file beside it. The robot's worker is the server of the
 * frame; another worker checks the file.
 */
import { Editor } from "./editor.js";
import { PythonWorker } from "./python_worker.js";
import { staticPage } from "./robot_html.js";
import { textOf } from "./text_link.js";

/** Time limit of a request to the robot; the longest one loads a document. */
const WITHIN_MS = 30_000;
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
/** The text of the running robot. */
let running = "";
/** The newest text without errors. */
let wanted = "";
let isOpening = false;

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
    page: async (query) => staticPage(await ask({ verb: "page", query })),
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
  if (!editor.text) editor.text = await (await fetch(new URL(FIRST, import.meta.url))).text();
  part("[data-tabs]").hidden = false;
  if (linked !== null) {
    view("text");
    void editor.check();
  }
}

/** Keep everything for later starts without a network, where the browser permits it. */
async function keepOffline() {
  if (!("serviceWorker" in navigator)) return;
  try {
    await navigator.serviceWorker.register(new URL("sw.js", import.meta.url));
    await navigator.serviceWorker.ready;
  } catch (error) {
    console.info("URC: the playground is not kept for use offline:", error);
  }
}

async function start() {
  go.disabled = true;
  try {
    await keepOffline();
    await open(editor.text);
    frame = document.createElement("iframe");
    frame.title = "Dashboard of the robot";
    frame.src = new URL("frame.html", import.meta.url).href;
    part("[data-robot]").replaceChildren(frame);
    navigator.serviceWorker?.controller?.postMessage("keep all");
  } catch (error) {
    tell(`The robot did not start: ${error instanceof Error ? error.message : error}`);
    go.disabled = false;
  }
}

/** @param {string} text */
async function open(text) {
  const name = await ask({ verb: "open", text });
  running = text;
  tell(`${name} runs in this page. No real robot moves.`);
}

/** Switch the robot to the newest valid text, and show its page. */
async function reopen() {
  if (isOpening) return;
  isOpening = true;
  try {
    while (frame && wanted !== running) {
      await open(wanted);
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
go.addEventListener("click", () => void start());
addEventListener("hashchange", () => location.reload());
void begin();
