// @ts-check
/**
 * The page's side of a worker with Python: requests with one reply each.
 *
 * @typedef {{resolve: (value: any) => void, reject: (fault: Error) => void, alarm: number}} Waiting
 */

export class PythonWorker {
  /** @param {(step: string) => void} onProgress receives the steps of loading */
  constructor(onProgress = () => {}) {
    this.onProgress = onProgress;
    /** @type {Map<number, Waiting>} */
    this.waiting = new Map();
    this.last = 0;
    /** @type {Worker | null} */
    this.worker = null;
    /** Whether the worker has answered at least once. */
    this.isReady = false;
  }

  /**
   * @param {object} said the request
   * @param {number} withinMs time limit after loading; a worker that takes longer is ended
   * @param {Transferable[]} [moved]
   * @returns {Promise<any>}
   */
  ask(said, withinMs, moved = []) {
    const worker = (this.worker ??= this.started());
    this.last += 1;
    const id = this.last;
    return new Promise((resolve, reject) => {
      // Loading takes long on slow machines and networks, and only loading has no time limit.
      const alarm = this.isReady ? window.setTimeout(() => this.end(`no result within ${withinMs / 1000} s`), withinMs) : 0;
      this.waiting.set(id, { resolve, reject, alarm });
      worker.postMessage({ id, ...said }, moved);
    });
  }

  started() {
    const worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
    worker.addEventListener("message", ({ data }) => {
      if (data.progress) this.onProgress(data.progress);
      else this.settle(data);
    });
    worker.addEventListener("error", (event) => this.end(event.message || "the worker could not start"));
    return worker;
  }

  /** @param {{id: number, value?: any, fault?: string}} said */
  settle({ id, value, fault }) {
    this.isReady = true;
    const asked = this.waiting.get(id);
    this.waiting.delete(id);
    clearTimeout(asked?.alarm);
    if (fault === undefined) asked?.resolve(value);
    else asked?.reject(new Error(fault));
  }

  /**
   * End the worker; the next request starts another.
   *
   * @param {string} reason
   */
  end(reason) {
    this.worker?.terminate();
    this.worker = null;
    this.isReady = false;
    const waiting = [...this.waiting.values()];
    this.waiting.clear();
    for (const { reject, alarm } of waiting) {
      clearTimeout(alarm);
      reject(new Error(reason));
    }
  }
}
