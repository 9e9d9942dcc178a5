// @ts-check
/**
 * The installation job in a dialog: download, permissions, approval and result. Closing the dialog
 * cancels an unapproved job.
 *
 * @typedef {import("./rows.js").Job} Job
 */
import { button, made } from "../core/dom.js";
import { t } from "../core/words.js";

export class JobDialog {
  /**
   * @param {HTMLDialogElement} el
   * @param {(path: string, body: object) => Promise<any>} act
   */
  constructor(el, act) {
    this.el = el;
    this.act = act;
    /** Number of the job that this page began. @type {number | null} */
    this.number = null;
    /** @type {Job | null} */
    this.job = null;
    this.drawn = "";
    /** Key of the button that opened the dialog. */
    this.from = "";
    el.addEventListener("cancel", (event) => {
      event.preventDefault();
      this.leave();
    });
  }

  /** Show a new job of this page. @param {Job} job */
  follow(job) {
    this.number = job.number;
    this.show(job);
  }

  /** @param {Job | null} job state from the server; jobs of other pages are ignored */
  show(job) {
    if (job === null || job.number !== this.number) return;
    this.job = job;
    const drawn = JSON.stringify(job);
    if (drawn === this.drawn && this.el.open) return;
    this.drawn = drawn;
    this.open(...this.parts(job));
    if (job.state === "asks") this.el.querySelector("h2")?.focus();
  }

  /**
   * Ask for confirmation of a removal.
   *
   * @param {string} wish
   * @param {string[]} gone
   * @param {boolean} hasSettings whether the package has settings
   * @param {(forget: boolean) => void} yes
   */
  confirm(wish, gone, hasSettings, yes) {
    const forget = /** @type {HTMLInputElement} */ (made("input", { type: "checkbox", checked: true, "data-forget": true }));
    this.number = null;
    this.job = null;
    this.open(
      title(t("Remove {name}?", { name: wish })),
      gone.length ? made("p", {}, t("To be removed:")) : made("p", {}, t("Its files stay: another package needs them.")),
      list(gone),
      hasSettings &&
        made("label", { class: "urc-check" }, forget, ` ${t("Also delete its settings and secrets")}`),
      made(
        "div",
        { class: "urc-ways" },
        button(t("Remove"), "yes", () => {
          this.close();
          yes(forget.checked);
        }, { class: "urc-button-main" }),
        button(t("Keep"), "no", () => this.close()),
      ),
    );
    this.el.querySelector("h2")?.focus();
  }

  /** @param {(Node | null | false)[]} parts */
  open(...parts) {
    const held = this.el.contains(document.activeElement) ? document.activeElement : null;
    const key = held instanceof HTMLElement ? held.dataset["key"] : undefined;
    this.el.replaceChildren(...parts.filter((one) => one instanceof Node));
    if (!this.el.open) {
      const before = document.activeElement;
      this.from = before instanceof HTMLElement ? (before.dataset["key"] ?? "") : "";
      this.el.showModal();
    }
    if (!key) return;
    const again = this.el.querySelector(`[data-key="${key}"]`);
    if (again instanceof HTMLElement) again.focus();
  }

  /**
   * Close the dialog. The button that opened it may have been redrawn, so the focus moves to the
   * element with the same key.
   */
  close() {
    this.number = null;
    this.drawn = "";
    this.el.close();
    const like = [...document.querySelectorAll("main [data-key]")].find(
      (one) => one instanceof HTMLElement && one.dataset["key"] === this.from,
    );
    const next = like instanceof HTMLElement ? like : document.getElementById("main");
    next?.focus();
  }

  /** Cancel the job, and close. */
  leave() {
    const { job, number } = this;
    const isOpen = number !== null && job !== null && (job.state === "working" || job.state === "asks");
    this.close();
    if (isOpen) void this.act("job/cancel", { number });
  }

  /** @param {Job} job */
  parts(job) {
    const isOver = job.state === "done" || job.state === "failed" || job.state === "cancelled";
    const isAsking = job.state === "asks";
    const line = {
      working: `… ${job.line}`,
      asks: t("Check the permissions, then decide."),
      done: `✓ ${t("installed")}`,
      failed: `▲ ${job.line}`,
      cancelled: `◆ ${t("Cancelled; nothing has changed")}`,
    }[job.state];
    return [
      title(isSwap(job) ? t("Update {name}", { name: job.title }) : t("Install {name}", { name: job.title })),
      made("p", { role: "status", "data-job-line": true, class: job.state === "failed" ? "urc-bad" : "" }, line),
      job.state === "working" && progress(job),
      ...(isAsking ? this.question(job) : []),
      ...job.notes.map((note) => made("p", { class: "urc-caution", lang: "en" }, `◆ ${note}`)),
      made(
        "div",
        { class: "urc-ways" },
        isAsking &&
          button(isSwap(job) ? t("Update") : t("Install"), "yes", () => void this.agree(job), {
            class: "urc-button-main",
            disabled: job.risks.length > 0 || job.unsigned.length > 0,
          }),
        isOver
          ? button(t("Close"), "close", () => this.close(), { class: "urc-button-main" })
          : button(t("Cancel"), "no", () => this.leave()),
      ),
    ];
  }

  /** @param {Job} job */
  question(job) {
    const { isUpdate } = job;
    const version = job.stays;
    const stays = t("{version} stays in use until another version is chosen in the settings of the robot.", { version });
    return [
      ...this.unsigned(job),
      ...this.risks(job),
      job.stays !== "" && made("p", { class: "urc-caution" }, `◆ ${stays}`),
      isUpdate && heading(t("Changes")),
      isUpdate && list(job.packages),
      heading(isUpdate ? t("New permissions") : t("Permissions")),
      list(isUpdate ? (job.gained.length ? job.gained : [t("nothing more")]) : job.may),
      isUpdate && job.lost.length > 0 && heading(t("Removed permissions")),
      isUpdate && list(job.lost),
      isUpdate && job.wire.length > 0 && made(
        "details",
        { class: "urc-more" },
        made("summary", {}, t("Changed connections")),
        made("pre", { tabindex: "0", lang: "en" }, job.wire.join("\n")),
      ),
      !isUpdate && heading(t("Source")),
      !isUpdate && list(job.packages),
    ];
  }

  /**
   * A package's access to this machine, with a separate approval.
   *
   * @param {Job} job
   */
  risks({ risks }) {
    if (risks.length === 0) return [];
    const yes = this.box("risks");
    return [
      made("h3", { class: "urc-row-title urc-bad" }, `▲ ${t("Automatically")}`),
      made("ul", { class: "urc-list urc-bad", "data-risks": true }, ...risks.map((one) => made("li", {}, one))),
      made("label", { class: "urc-check" }, yes, ` ${t("Allow it")}`),
    ];
  }

  /**
   * Unsigned packages, which are refused unless the user accepts each package by name.
   *
   * @param {Job} job
   */
  unsigned({ unsigned }) {
    if (unsigned.length === 0) return [];
    return [
      made("h3", { class: "urc-row-title urc-bad" }, `▲ ${t("Refused: not signed")}`),
      made("p", { class: "urc-bad" }, t("Anyone on the network could have changed this package. Ask its author for a signed version.")),
      ...unsigned.map((name) =>
        made(
          "label",
          { class: "urc-check" },
          this.box(`unsigned ${name}`),
          " ",
          t("Accept {name} without a signature", { name }),
        ),
      ),
    ];
  }

  /**
   * A required approval. The main button stays disabled until all approvals are checked.
   *
   * @param {string} key
   * @returns {HTMLInputElement}
   */
  box(key) {
    const box = document.createElement("input");
    box.type = "checkbox";
    box.dataset["key"] = key;
    box.addEventListener("change", () => {
      const all = [...this.el.querySelectorAll("input[type=checkbox]")];
      const install = this.el.querySelector("[data-key='yes']");
      const isWhole = all.every((one) => one instanceof HTMLInputElement && one.checked);
      if (install instanceof HTMLButtonElement) install.disabled = !isWhole;
    });
    return box;
  }

  /** @param {Job} job */
  async agree(job) {
    for (const one of this.el.querySelectorAll("button")) one.disabled = true;
    const answer = await this.act("job/agree", {
      number: job.number,
      takesRisks: job.risks.length > 0,
      unsigned: job.unsigned,
    });
    if (!answer) this.close();
  }
}

/** @param {Job} job @returns {boolean} whether the job replaces the version in use */
function isSwap({ isUpdate, stays }) {
  return isUpdate && stays === "";
}

/** @param {string} text */
function title(text) {
  return made("h2", { class: "urc-part-title", id: "job-title", tabindex: "-1" }, text);
}

/** @param {string} text */
function heading(text) {
  return made("h3", { class: "urc-row-title" }, text);
}

/** @param {string[]} lines the server's texts about documents */
function list(lines) {
  if (lines.length === 0) return null;
  return made("ul", { class: "urc-list" }, ...lines.map((one) => made("li", {}, one)));
}

/** @param {Job} job */
function progress({ done, of }) {
  const value = of > 0 ? String(done) : "";
  return made("progress", { "aria-label": t("Progress"), value, max: value && String(of) });
}
