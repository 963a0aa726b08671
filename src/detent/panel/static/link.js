// The way to the axis: one WebSocket, answers by mark, endings by id, rows of the scope in binary.

const RETRY = 500; // ms until the next attempt
const KEEP_JOB = 500; // ms between two keep-alives of a job, which lives for 2 s without one
const PATIENCE = 5000; // ms until a command without an answer counts as lost
export const STALE = 500; // ms after which what is shown is no longer current

/** What the server gave the page to say back: another page cannot know it. */
function mark() {
  return document.querySelector('meta[name="csrf-token"]').content;
}

/** Ask the server over HTTP; gives the answer, or throws a sentence. */
export async function ask(path, options = {}) {
  const answer = await fetch(path, { cache: "no-store", ...options, headers: { "X-CSRF-Token": mark() } });
  const isData = (answer.headers.get("content-type") ?? "").includes("json");
  const told = isData ? await answer.json() : await answer.text();
  if (!answer.ok) throw new Error(isData ? told.error : told.trim());
  return told;
}

/** Events: "status", "rows", "ended", "open", "lost". */
export class Link extends EventTarget {
  constructor(socket = (address) => new WebSocket(address)) {
    super();
    this.make = socket;
    this.about = null;
    this.now = null; // the last message of status
    this.heard = -Infinity; // when
    this.isOpen = false;
    this.kept = 0; // when a job of this page was kept last
    this.marks = 0;
    this.waiting = new Map(); // mark: what to do with the answer
    this.running = new Map(); // id: what to do with the ending
    this.endings = []; // that came before their id: [id, ended]
    this.watching = []; // channels, in the order of their columns
    this.isSwitching = false;
    this.rows = { first: 0, count: 0, channels: [], columns: null };
  }

  /** Time since the last message [ms]. */
  get age() { return performance.now() - this.heard; }

  get isCurrent() { return this.isOpen && this.age < STALE; }

  async connect() {
    try {
      const { ticket } = await ask("/api/ticket", { method: "POST" });
      this.about = await ask("/api/describe");
      const scheme = location.protocol === "https:" ? "wss:" : "ws:";
      this.open(`${scheme}//${location.host}/ws`, ticket);
    } catch (error) {
      this.trouble = error.message;
      this.lost();
    }
  }

  open(address, ticket) {
    const socket = this.socket = this.make(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => socket.send(JSON.stringify({ ticket }));
    socket.onmessage = (event) => this.receive(event.data);
    socket.onclose = (event) => {
      this.trouble = event.reason;
      this.lost();
    };
  }

  lost() {
    this.isOpen = false;
    for (const [, { fail }] of this.waiting) fail(new Error("the connection is lost; the axis stops what it had begun"));
    for (const [, fail] of this.running) fail({ how: "lost", reason: "the connection is lost", remedy: "look at the axis" });
    this.waiting.clear();
    this.running.clear();
    this.dispatchEvent(new Event("lost"));
    setTimeout(() => this.connect(), RETRY);
  }

  /** A message of the server: text is JSON, binary are rows. */
  receive(data) {
    this.heard = performance.now();
    if (typeof data !== "string") return this.take(data);
    const message = JSON.parse(data);
    if (message.status) this.accept(message);
    else if (message.ended) this.end(message.ended);
    else if ("as" in message) this.answer(message);
  }

  accept(message) {
    this.now = message;
    if (message.status.job && message.holder === message.you && this.heard - this.kept > KEEP_JOB) {
      this.kept = this.heard; // with what it hears, for timers of a hidden page come late
      this.send({ do: "keep" });
    }
    if (!this.isOpen) {
      this.isOpen = true;
      this.trouble = "";
      this.dispatchEvent(new Event("open"));
      if (this.watching.length) this.watch(this.watching);
    }
    this.dispatchEvent(new Event("status"));
  }

  answer(message) {
    const asked = this.waiting.get(message.as);
    if (!asked) return;
    this.waiting.delete(message.as);
    clearTimeout(asked.timer);
    if (message.error) asked.fail(new Error(message.error));
    else asked.done(message);
  }

  end(ended) {
    const told = this.running.get(ended.id);
    this.running.delete(ended.id);
    if (told) told(ended);
    else this.endings = [...this.endings.slice(-15), ended];
    this.dispatchEvent(new CustomEvent("ended", { detail: ended }));
  }

  take(data) {
    if (this.isSwitching) return;
    const head = new DataView(data);
    const [count, channels] = [head.getInt32(8, true), head.getInt32(12, true)];
    if (channels !== this.watching.length || count < 1) return;
    this.rows.first = Number(head.getBigInt64(0, true));
    this.rows.count = count;
    this.rows.channels = this.watching;
    this.rows.columns = new Float32Array(data, 16, count * channels);
    this.dispatchEvent(new Event("rows"));
  }

  /** Ask for something; the promise gives the answer, or throws the refusal. */
  request(message) {
    if (this.socket?.readyState !== 1) return Promise.reject(new Error("no connection to the axis; it is being tried again"));
    const as = ++this.marks;
    return new Promise((done, fail) => {
      const late = () => {
        this.waiting.delete(as);
        fail(new Error("no answer for 5 s; look at the axis and at what runs it"));
      };
      this.waiting.set(as, { done, fail, timer: setTimeout(late, PATIENCE) });
      this.socket.send(JSON.stringify({ ...message, as }));
    });
  }

  /** Send without waiting for an answer: keep-alives. */
  send(message) {
    if (this.socket?.readyState === 1) this.socket.send(JSON.stringify(message));
  }

  /** A command; gives {id, ended}, `ended` a promise of how it has ended. */
  async command(word, value, speed) {
    const message = { do: word };
    if (value !== undefined) message.value = value;
    if (speed !== undefined) message.speed = speed;
    const { id } = await this.request(message);
    const early = this.endings.find((one) => one.id === id);
    return { id, ended: early ? Promise.resolve(early) : new Promise((told) => this.running.set(id, told)) };
  }

  /** Stop, by every way there is; never waits for an answer. */
  stop() {
    this.send({ do: "stop" });
    fetch("/stop", { method: "POST", keepalive: true, headers: { Accept: "application/json" } }).catch(() => {});
  }

  /** Choose the channels whose rows come. */
  async watch(channels) {
    this.watching = [...channels];
    if (!this.isOpen) return;
    this.isSwitching = true;
    try {
      await this.request({ do: "watch", channels: this.watching });
    } finally {
      this.isSwitching = false;
    }
  }
}
