// The panel: what is always on the screen, the views, the keys. STOP works before this file has loaded: it is a form.

import { fill, h, mark, say } from "./dom.js";
import { STALE, Link } from "./link.js";
import { number, shown } from "./units.js";

const VIEWS = [
  ["status", "Status"], ["jog", "Jog"], ["positions", "Positions"], ["home", "Home"], ["job", "Job"], ["scope", "Scope"],
  ["method", "Method"], ["faults", "Faults"], ["loop", "Loop"], ["file", "Axis file"], ["log", "Log"],
];
const SHAPES = { // of a state: a sign beside the word, so that colour is not alone
  "operation enabled": ["●", "good"], "quick stop active": ["◆", "warn"], "fault reaction active": ["▲", "bad"],
  fault: ["▲", "bad"],
};
const REMEDIES = ["enable", "confirm", "reset", "home", "take", "trust"]; // words that are buttons beside their reason
const LABELS = { enable: "Enable", confirm: "Confirm: full speed", reset: "Reset", home: "Home", take: "Take command", trust: "I know where it is" };

const OPENS = { h: "home", g: "positions", t: "positions" }; // keys that open a view

const $ = (id) => document.getElementById(id);
const link = new Link();
let view = null; // the open one: {status?, close?, key?}
let name = "";
let frame = 0;

/** Tell what came of something, in the line that is read aloud. */
function tell(text, level = "") {
  say($("told"), text);
  $("told").className = level;
}

/** Ask for a command and tell how it ended; gives the ending, or null where it was not taken. */
async function act(word, value, speed) {
  tell(`${word.replace("_", " ")}: under way`);
  try {
    const { ended } = await link.command(word, value, speed);
    const how = await ended;
    const code = how.code ? ` (${how.code})` : "";
    const why = [how.reason, how.remedy].filter(Boolean).join("; ");
    tell(`${word.replace("_", " ")}: ${how.how}${code}${why ? `, ${why}` : ""}`, how.how === "done" ? "good" : "warn");
    return how;
  } catch (error) {
    tell(`${word.replace("_", " ")}: ${error.message}`, "bad");
    return null;
  }
}

const context = { link, tell, act, go: (to) => { location.hash = to; } };

// ---- what is always there

function stop() {
  link.stop();
  tell("STOP was pressed");
}

function wireStop() {
  const form = $("stop-form");
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    stop();
  });
  form.querySelector("button").addEventListener("pointerdown", stop); // at the press, not at the release
  $("off").addEventListener("click", () => act("disable"));
}

/** The reasons why it does not move, each with its remedy, as a button where that is a command. */
function showReasons(why, running) {
  const told = JSON.stringify([why, running, name]);
  if (showReasons.last === told) return;
  showReasons.last = told;
  const offered = link.about.commands;
  fill($("why"), why.map(([what, remedy]) => {
    const word = REMEDIES.find((one) => remedy.split(/\W+/).includes(one) && offered.includes(one));
    const button = word && h("button", { class: "small", onclick: () => act(word, word === "trust" ? 2 : undefined) }, LABELS[word]);
    return h("li", {}, h("span", {}, `${what}: `, h("b", {}, remedy)), button);
  }));
  const isSaidThere = name === "faults" && why.some(([what]) => what.startsWith("fault ")); // and at more length
  $("why-box").hidden = why.length === 0 || isSaidThere || (name !== "status" && why.every(([what]) => what.startsWith("nothing")));
}

function showStatus() {
  frame = 0;
  const { status, why, clients, you, holder } = link.now;
  const unit = link.about.unit;
  const [shape, level] = SHAPES[status.state] ?? ["○", ""];
  say($("shape"), shape);
  say($("state"), status.state);
  $("state-box").className = `state ${level}`;
  say($("place"), number(status.position, unit));
  say($("unit"), shown(unit).name);
  say($("trust"), status.trust);
  $("trust").className = `trust ${status.trust === "referenced" ? "good" : "warn"}`;
  const who = holder ? (holder === you ? "you command" : `${link.now.holder_name || "somebody else"} commands`) : "nobody commands";
  const barred = { local: "faces may not command, ", remote: "only faces may command, " }[status.selector] ?? "";
  say($("who"), `${link.now.lost ? `${link.now.lost}; ` : ""}${who}, ${barred}${clients} ${clients === 1 ? "page or program" : "pages and programs"}`);
  mark($("who"), "warn", (holder && holder !== you) || link.now.lost || barred);
  say($("doing"), status.running ? status.running.command : status.rests ? "at rest" : "moving");
  const free = link.about.limits && status.trust === "unknown"; // nobody knows where they are
  say($("limits"), free ? "limits NOT active: position unknown" : status.limited && level === "good" ? "at the limit of effort" : status.confirmed ? "" : "a tenth of the speed until confirmed");
  showReasons(why, status.running);
  view?.status?.(status, link.now);
  $("updates").value = String(++showStatus.count);
}
showStatus.count = 0;

/** What is shown is current, or greyed out and said not to be. */
function showAge() {
  const { age } = link;
  const current = link.isOpen && age < STALE;
  mark(document.body, "stale", !current);
  const said = current ? `link ${Math.round(age / 20) * 20} ms` : "not current: no news from the axis";
  say($("age"), link.trouble && !current ? `${said} (${link.trouble})` : said);
}

// ---- views

async function open() {
  const wanted = location.hash.slice(1) || "status";
  const known = VIEWS.some(([one]) => one === wanted) ? wanted : "status";
  if (known === name) return;
  view?.close?.();
  view = null;
  name = known;
  for (const one of $("views").children) {
    if (one.hash === `#${known}`) {
      one.setAttribute("aria-current", "page");
      one.scrollIntoView({ block: "nearest", inline: "center" });
    } else one.removeAttribute("aria-current");
  }
  const place = $("view");
  fill(place, h("p", {}, "…"));
  const module = await import(known === "method" ? "/static/method.js" : `./views/${known}.js`).catch((error) => error);
  if (name !== known) return;
  fill(place);
  if (module instanceof Error) fill(place, h("p", {}, `This view could not be loaded: ${module.message}`));
  else view = module.open(place, context);
  if (link.now) view?.status?.(link.now.status, link.now);
  document.body.dataset.view = known;
}

// ---- keys: none moves the axis unless the jog pad has the focus

function onKey(event) {
  if (event.key === "Escape") {
    stop();
    return;
  }
  const typing = event.target.closest?.("input, textarea, select, [contenteditable]");
  if (typing || event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
  if (event.key === " " && !event.target.closest?.("button, a, summary")) {
    event.preventDefault();
    stop();
  } else if (event.key === "?") $("help").showModal();
  else if (event.key.toLowerCase() in OPENS) location.hash = OPENS[event.key.toLowerCase()]; // a button there asks for the rest
  else if (event.key === "F2") act(link.now?.status.state === "operation enabled" ? "disable" : "enable");
  else view?.key?.(event);
}

function start() {
  fill($("views"), VIEWS.map(([one, text]) => h("a", { href: `#${one}` }, text)));
  wireStop();
  addEventListener("keydown", onKey, true);
  addEventListener("hashchange", open);
  $("help-open").addEventListener("click", () => $("help").showModal());
  $("help-close").addEventListener("click", () => $("help").close());
  link.addEventListener("open", () => {
    const own = [...$("views").children].find((one) => one.hash === "#method");
    own.hidden = !link.about.view.title;
    say(own, link.about.view.title ?? "");
    if (name === "") open();
  });
  link.addEventListener("lost", () => tell("The connection is lost; the axis stops what this page had begun.", "bad"));
  link.addEventListener("status", () => { frame ||= requestAnimationFrame(showStatus); });
  setInterval(showAge, 100);
  link.connect();
}

window.panel = { link }; // for tests and the curious, in the console
start();
