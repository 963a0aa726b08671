// The memory of the scope and its trigger: numbers only, no page, so that it can be tried without one.

export const KEPT = 1 << 15; // rows that are kept, 32 s at 1 kHz

/** The last rows, column by column. Rows that were missed empty it: what it holds is without a gap. */
export class Rows {
  constructor(channels, kept = KEPT) {
    this.channels = channels;
    this.kept = kept;
    this.columns = channels.map(() => new Float32Array(kept));
    this.first = this.next = 0; // numbers of the oldest row and of the one to come
    this.gaps = 0;
  }

  /** Take `count` rows from number `first` on; `data` holds column after column. */
  take(first, count, data) {
    if (first !== this.next) {
      if (this.next) this.gaps += 1;
      this.first = this.next = first;
    }
    const skip = Math.max(0, count - this.kept);
    this.columns.forEach((column, k) => {
      const from = data.subarray(k * count + skip, (k + 1) * count);
      const at = (first + skip) % this.kept;
      const fits = Math.min(from.length, this.kept - at);
      column.set(from.subarray(0, fits), at);
      column.set(from.subarray(fits), 0);
    });
    this.next = first + count;
    this.first = Math.max(this.first, this.next - this.kept);
  }

  /** Value of a channel in a row. */
  at(channel, row) { return this.columns[channel][row % this.kept]; }

  /** Copy rows of a channel, times a factor, into an array. */
  copy(channel, first, into, factor = 1) {
    const column = this.columns[channel];
    for (let k = 0, at = first % this.kept; k < into.length; k += 1, at += 1) {
      if (at === this.kept) at = 0;
      into[k] = column[at] * factor;
    }
  }
}

/** Whether a row triggers: {kind: "edge" | "level" | "fault", channel, level, rising}. */
function fires(rows, row, { kind, channel, level, rising }) {
  const now = rows.at(channel, row);
  if (kind === "level") return rising ? now >= level : now <= level;
  if (row <= rows.first) return false;
  const before = rows.at(channel, row - 1);
  if (kind === "fault") return before === 0 && now !== 0;
  return rising ? before < level && now >= level : before > level && now <= level;
}

/** One capture: `length` rows, of which a share `before` lies before the trigger. */
export class Capture {
  constructor(rows, trigger, length, before) {
    this.rows = rows;
    this.trigger = trigger;
    this.length = length;
    this.before = Math.round(length * before);
    this.looked = rows.next; // row that is looked at next
    this.armed = rows.next; // nothing before triggers
    this.row = -1; // that has triggered
    this.gaps = rows.gaps;
  }

  /** Look at the rows that are new; true once the record is whole. */
  look() {
    const { rows } = this;
    if (rows.gaps !== this.gaps) { // begin again: a record has no gap
      [this.gaps, this.row, this.looked] = [rows.gaps, -1, rows.first];
    }
    for (let row = Math.max(this.looked, rows.first + this.before); this.row < 0 && row < rows.next; row += 1) {
      if (fires(rows, row, this.trigger)) this.row = row;
    }
    this.looked = Math.max(this.looked, rows.next);
    return this.row >= 0 && rows.next >= this.row - this.before + this.length;
  }

  /** First row of the record. */
  get first() { return this.row - this.before; }
}

/** Mean of squares, largest and smallest, between two places of a column. */
export function measure(column, from, to) {
  const [begin, end] = from <= to ? [from, to] : [to, from];
  let [squares, low, high] = [0, Infinity, -Infinity];
  for (let k = begin; k <= end; k += 1) {
    squares += column[k] ** 2;
    low = Math.min(low, column[k]);
    high = Math.max(high, column[k]);
  }
  return { rms: Math.sqrt(squares / (end - begin + 1)), peak: high - low };
}
