// Home: what the position is worth, and how the reference is found.

import { h, say } from "../dom.js";
import { quantity } from "../units.js";

const MEANS = {
  unknown: "Nobody knows where it is: it creeps, and goes to no position until it has been homed.",
  restored: "Taken from the last parking place; homing makes it sure.",
  referenced: "Measured against the reference: it may go to any position inside its limits.",
};

export function open(root, { link, act }) {
  const { unit, commands } = link.about;
  const trust = h("strong", { class: "big" });
  const means = h("p");
  const steps = ["Look for the reference", "Found: take it as the origin", "Stand in the window, at rest"].map((one) => h("li", {}, one));
  const result = h("p", { id: "home-result", role: "status" });
  let since = null;
  const home = h("button", { id: "home", onclick: async () => {
    since = link.now.status.position;
    say(result, "Homing: STOP ends it at any time.");
    const how = await act("home");
    const at = quantity(link.now.status.position, unit);
    say(result, how?.how === "done" ? `Homed: it stands at ${at}.` : how ? `Not homed (${how.how}): ${how.reason}` : "Not homed.");
    since = null;
  } }, "Home now");
  root.append(h("h1", {}, "Home"), h("p", {}, "The position is ", trust, "."), means,
    commands.includes("home") ? h("div", {}, h("p", {}, "The axis moves slowly until it finds its reference. Keep clear of it."), home,
      h("ol", { class: "steps" }, steps))
      : h("p", {}, "This axis has no homing: its sensor knows the position from power-on, or its file begins at a known place."), result);
  return {
    status(s) {
      say(trust, s.trust);
      say(means, MEANS[s.trust]);
      const at = since === null ? -1 : s.trust === "unknown" ? 0 : s.in_window ? 2 : 1;
      steps.forEach((one, k) => {
        if (k === at) one.setAttribute("aria-current", "step");
        else one.removeAttribute("aria-current");
      });
    },
  };
}
