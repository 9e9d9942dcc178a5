// @ts-check
/**
 * The paused history: uPlot with zoom and a cursor, loaded on demand.
 *
 * @typedef {{title: string, unit: string, colour: string, dash: number[], isShown: boolean}} Line
 * @typedef {{times: number[], columns: (number | null | undefined)[][]}} Rows values in the signals' units
 * @typedef {{colour: string, grid: string, epoch: number, moved: (at: number | null) => void,
 *   factor: (value: number) => number}} Look `factor` converts to the displayed unit.
 */

/** uPlot's own types do not fit this page. @typedef {any} Plot */

export class History {
  /**
   * @param {HTMLElement} place
   * @param {readonly Line[]} lines
   * @param {Rows} rows
   * @param {Look} look
   * @returns {Promise<History>}
   */
  static async open(place, lines, rows, look) {
    const name = "uplot";
    const { default: Chart } = await import(name);
    const plot = new Chart(settings(place, lines, look), shownRows(rows, look.factor), place);
    return new History(place, plot, rows, look.factor);
  }

  /**
   * @param {HTMLElement} place
   * @param {Plot} plot
   * @param {Rows} rows
   * @param {Look["factor"]} factor
   */
  constructor(place, plot, rows, factor) {
    this.plot = plot;
    this.rows = rows;
    this.factor = factor;
    this.sizes = new ResizeObserver(() => plot.setSize(sizeOf(place)));
    this.sizes.observe(place);
  }

  /** Visible range, in seconds. @returns {[number, number]} */
  get span() {
    const { min, max } = this.plot.scales.x;
    return [min, max];
  }

  /**
   * Zoom around the cursor, or around the middle.
   *
   * @param {number} factor below 1 zooms in
   */
  zoom(factor) {
    const times = this.plot.data[0];
    const [from, to] = this.span;
    const { left } = this.plot.cursor;
    const middle = left > 0 ? this.plot.posToVal(left, "x") : (from + to) / 2;
    const [first, last] = [times[0] ?? from, times[times.length - 1] ?? to];
    const min = Math.max(first, middle - (middle - from) * factor);
    const max = Math.min(last, middle + (to - middle) * factor);
    if (max - min > 1e-3) this.plot.setScale("x", { min, max });
  }

  /** @param {number} step readings to move the cursor by */
  move(step) {
    const times = this.plot.data[0];
    const [from, to] = this.span;
    const now = this.plot.cursor.idx ?? times.findIndex((/** @type {number} */ time) => time >= from);
    const next = Math.min(times.length - 1, Math.max(0, now + step));
    const time = Math.min(to, Math.max(from, times[next] ?? from));
    this.plot.setCursor({ left: this.plot.valToPos(time, "x"), top: 10 });
  }

  /**
   * @param {number} index of the line
   * @param {boolean} isShown
   */
  show(index, isShown) {
    this.plot.setSeries(index + 1, { show: isShown });
  }

  /** Redraw the same range in the displayed unit. */
  convert() {
    const [min, max] = this.span;
    this.plot.batch(() => {
      this.plot.setData(shownRows(this.rows, this.factor));
      this.plot.setScale("x", { min, max });
    });
  }

  /** Values at the cursor or, without a cursor, at the end. */
  get values() {
    const { idx } = this.plot.cursor;
    const row = typeof idx === "number" ? idx : this.rows.times.length - 1;
    return this.rows.columns.map((column) => nearest(column, row));
  }

  close() {
    this.sizes.disconnect();
    this.plot.destroy();
  }
}

/**
 * @param {Rows} rows
 * @param {Look["factor"]} factor
 */
function shownRows({ times, columns }, factor) {
  return [times, ...columns.map((column) => column.map((value) => (typeof value === "number" ? factor(value) : value)))];
}

/**
 * Return the value at a row, or null in a gap: signals rarely arrive at the same time.
 *
 * @param {readonly (number | null | undefined)[]} column
 * @param {number} row
 */
function nearest(column, row) {
  for (let place = row; place >= 0; place -= 1) {
    const value = column[place];
    if (value !== undefined) return value;
  }
  return null;
}

/**
 * @param {HTMLElement} place
 * @param {readonly Line[]} lines
 * @param {Look} look
 */
function settings(place, lines, { colour, grid, epoch, moved }) {
  const axis = { stroke: colour, grid: { stroke: grid, width: 1 }, ticks: { stroke: grid, width: 1 } };
  const clock = new Intl.DateTimeFormat([], { hour: "2-digit", minute: "2-digit", second: "2-digit", fractionalSecondDigits: 1, hour12: false });
  const when = (/** @type {number} */ time) => clock.format(epoch + time * 1000);
  return {
    ...sizeOf(place),
    legend: { show: false },
    cursor: { drag: { x: true, y: false }, focus: { prox: 24 } },
    scales: { x: { time: false } },
    axes: [
      { ...axis, values: (/** @type {Plot} */ _, /** @type {number[]} */ splits) => splits.map(when), space: 96 },
      axis,
    ],
    series: [
      {},
      ...lines.map((line) => ({
        label: line.title,
        stroke: line.colour,
        dash: line.dash,
        width: 2,
        show: line.isShown,
        points: { show: false },
        spanGaps: false,
      })),
    ],
    hooks: {
      setCursor: [(/** @type {Plot} */ plot) => {
        const { idx } = plot.cursor;
        moved(typeof idx === "number" ? plot.data[0][idx] : null);
      }],
    },
  };
}

/** @param {Element} place */
function sizeOf(place) {
  return { width: Math.max(60, place.clientWidth), height: Math.max(60, place.clientHeight) };
}
