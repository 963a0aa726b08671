// Motion for exactly as long as somebody holds it. Whatever can end a hold, ends it; nothing but a new press begins one.

const KEEP = 50; // ms between two keep-alives
const GAP = 180; // ms without one, after which the page was too busy to be trusted: the hold is over

/** A jog that lives while it is held. `told(text)` says how it ended. */
export class Hold {
  constructor(link, told) {
    this.link = link;
    this.told = told;
    this.held = null;
    this.leaving = new AbortController();
    const { signal } = this.leaving;
    const end = (why) => () => this.end(why);
    for (const [target, name, why] of [
      [window, "blur", "the window lost the focus"], [document, "visibilitychange", "the page was hidden"],
      [window, "pagehide", "the page was left"], [document, "contextmenu", "a menu opened"],
      [link, "lost", "the connection was lost"], [document, "freeze", "the page was put to sleep"],
    ]) target.addEventListener(name, end(why), { signal, capture: true });
  }

  /** Begin; `source` is what is held: a pointer's id or a key. */
  begin(source, velocity, element) {
    if (this.held || !this.link.isCurrent || document.visibilityState !== "visible") return false;
    const held = this.held = { source, element, at: performance.now() };
    element?.classList.add("held");
    element?.setAttribute("aria-pressed", "true");
    this.link.command("jog", velocity).then(
      ({ ended }) => ended.then((how) => this.over(held, how)), (error) => this.over(held, { reason: error.message }));
    held.timer = setInterval(() => this.keep(held), KEEP);
    return true;
  }

  /** Keep the jog alive, as long as page and connection are. */
  keep(held) {
    const now = performance.now();
    if (now - held.at > GAP) return this.end("the page was held up");
    if (!this.link.isCurrent) return this.end("the connection was lost");
    if (!document.hasFocus()) return this.end("the window lost the focus");
    held.at = now;
    return this.link.send({ do: "keep" });
  }

  /** The axis has ended it: a limit, a fault, another client. */
  over(held, how) {
    if (this.held !== held) return;
    this.let();
    this.told(how.reason ? `${how.reason}${how.remedy ? `; ${how.remedy}` : ""}` : "the jog has ended");
  }

  /** What held it let go; `source` given: only where it was this one. */
  end(why, source) {
    if (!this.held || (source !== undefined && this.held.source !== source)) return;
    this.let();
    this.link.send({ do: "stop" });
    this.told(why);
  }

  let() {
    clearInterval(this.held.timer);
    this.held.element?.classList.remove("held");
    this.held.element?.setAttribute("aria-pressed", "false");
    this.held = null;
  }

  /** A button that jogs while it is pressed, by any pointer or by Space and Enter. */
  button(element, velocity) {
    const up = (event) => this.end("released", event.pointerId);
    element.setAttribute("aria-pressed", "false");
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      element.focus();
      element.setPointerCapture(event.pointerId);
      this.begin(event.pointerId, velocity(), element);
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) element.addEventListener(name, up);
    element.addEventListener("touchend", () => this.end("released"));
    element.addEventListener("keydown", (event) => {
      if (![" ", "Enter"].includes(event.key)) return;
      event.preventDefault();
      event.stopPropagation();
      if (!event.repeat) this.begin(event.key, velocity(), element);
    });
    element.addEventListener("keyup", () => this.end("released"));
    element.addEventListener("blur", () => this.end("the button lost the focus"));
    return element;
  }

  /** The view is left. */
  close() {
    this.end("the view was left");
    this.leaving.abort();
  }
}
