// @ts-check
/**
 * The screen of the device: fullscreen mode, and wake lock during control.
 */
import { t } from "urc/kit";

/** The button for fullscreen mode; hidden in browsers without this mode. */
export class FullScreen {
  /**
   * @param {HTMLElement | null} button
   * @param {(text: string) => void} tell
   */
  constructor(button, tell) {
    if (!button || !document.fullscreenEnabled) return;
    button.hidden = false;
    button.addEventListener("click", async () => {
      try {
        if (document.fullscreenElement) await document.exitFullscreen();
        else await document.documentElement.requestFullscreen({ navigationUI: "hide" });
      } catch {
        tell(t("This browser did not allow full screen."));
      }
    });
    document.addEventListener("fullscreenchange", () => {
      button.setAttribute("aria-pressed", String(document.fullscreenElement !== null));
    });
  }
}

/**
 * Keeps the screen on while this page is in control. A browser revokes the lock whenever the page
 * is hidden, so the page requests it again when it returns.
 */
export class WakeLock {
  /** @param {(text: string) => void} tell called once if the screen may go dark */
  constructor(tell) {
    this.tell = tell;
    this.isWanted = false;
    this.isAsking = false;
    this.wasTold = false;
    /** @type {WakeLockSentinel | null} */
    this.lock = null;
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden) void this.ask();
    });
  }

  /** @param {boolean} isWanted */
  want(isWanted) {
    if (isWanted === this.isWanted) return;
    this.isWanted = isWanted;
    if (isWanted) void this.ask();
    else void this.drop();
  }

  async ask() {
    if (!this.isWanted || this.isAsking || document.hidden || (this.lock && !this.lock.released)) return;
    this.isAsking = true;
    try {
      if (!("wakeLock" in navigator)) throw new Error("no wake lock");
      this.lock = await navigator.wakeLock.request("screen");
    } catch {
      // Browsers refuse the lock without HTTPS or on a low battery. Driving continues in any case.
      if (!this.wasTold) this.tell(t("The screen may go dark while you drive: this browser does not keep it on."));
      this.wasTold = true;
    } finally {
      this.isAsking = false;
    }
    if (!this.isWanted) await this.drop();
  }

  async drop() {
    const lock = this.lock;
    this.lock = null;
    try {
      await lock?.release();
    } catch {
      // It was released already.
    }
  }
}
