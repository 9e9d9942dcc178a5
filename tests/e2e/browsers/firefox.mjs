// Drives one page of a Firefox over WebDriver BiDi: an order is a line of JSON on standard input, its
// answer a line on standard output. The program ends with its standard input.
//
//     node firefox.mjs EXECUTABLE WIDTH HEIGHT
//     {"do": "evaluate", "with": ["1 + 1"]}   →   {"value": 2}
import { createInterface } from "node:readline";
import puppeteer from "puppeteer-core";

const LONGEST_MS = 60_000;
const [executablePath, width, height] = process.argv.slice(2);

const browser = await puppeteer.launch({
  browser: "firefox",
  executablePath,
  headless: true,
  timeout: LONGEST_MS,
  protocolTimeout: LONGEST_MS,
  defaultViewport: { width: Number(width), height: Number(height) },
});
const [page] = await browser.pages();
page.setDefaultTimeout(LONGEST_MS);

/** Errors of the console, exceptions, and violations of the pages' policy. */
const faults = [];
page.on("console", (message) => {
  if (message.type() === "error") faults.push(`console: ${message.text()}`);
});
page.on("pageerror", (error) => faults.push(`exception: ${error.stack || error.message}`));
await page.evaluateOnNewDocument(() => {
  document.addEventListener("securitypolicyviolation", (event) => {
    console.error(`CSP violation: ${event.violatedDirective} blocked ${event.blockedURI}`);
  });
});

const ORDERS = {
  version: () => browser.version(),
  goto: async (address) => void (await page.goto(address)),
  evaluate: (expression) => page.evaluate(expression),
  press: async (x, y) => {
    await page.mouse.move(x, y);
    await page.mouse.down();
  },
  move: (x, y) => page.mouse.move(x, y),
  release: () => page.mouse.up(),
  resize: (wide, high) => page.setViewport({ width: wide, height: high }),
  screenshot: async (path) => void (await page.screenshot({ path })),
  faults: () => faults,
};

try {
  for await (const line of createInterface({ input: process.stdin })) {
    const order = JSON.parse(line);
    let answer;
    try {
      answer = { value: (await ORDERS[order.do](...order.with)) ?? null };
    } catch (error) {
      answer = { error: String(error) };
    }
    process.stdout.write(`${JSON.stringify(answer)}\n`);
  }
} finally {
  await browser.close();
}
