// The experimenter's page: who is where, how far, and what can be stopped.

import { find, make, setText } from "./dom.js";
import { StudySocket } from "./study_socket.js";

const KINDS = { consent: "consent", questions: "questions", thanks: "the end" };
const rows = new Map(); // by code
let shown = null;
let doomed = ""; // whom the question is about

const socket = new StudySocket({
  onShown: show,
  onNote: (text) => setText(find("note"), text || ""),
  onState: (connected) => setText(find("note"), connected ? "" : "The connection is lost. Trying again."),
});

function show(now) {
  shown = now;
  setText(find("title"), now.title);
  document.title = `${now.title}: experimenter`;
  const count = (state) => now.participants.filter((each) => each.state === state).length;
  const running = now.participants.filter((each) => each.robot).length;
  setText(find("summary"), `${now.open ? "" : "The study is stopped. "}${count("finished")} have finished, ${count("active")} are at it, ` +
    `${count("stopped")} are stopped, ${count("invited")} have not begun, ${now.withdrawn} have withdrawn. Robots: ${running}.`);
  setText(find("close"), now.open ? "Stop the study" : "Go on with the study");
  setText(find("files"), `Everything is in ${now.database}. To have it as CSV and JSON: deixis study export ${now.database}`);
  const codes = new Set(now.participants.map((each) => each.code));
  for (const [code, row] of rows) {
    if (codes.has(code)) continue;
    row.element.remove();
    rows.delete(code);
  }
  now.participants.forEach((person) => fill(rows.get(person.code) ?? build(person.code), person));
}

function build(code) {
  const link = new URL(`../${code}/`, document.baseURI).href;
  const copy = make("button", { type: "button", ariaLabel: `Copy link of ${code}`, onclick: () => copied(copy, link) }, "Copy link");
  const cell = () => make("td", {});
  const parts = { where: cell(), there: cell(), robot: cell(), events: cell(), bar: make("progress", { max: 1, value: 0, ariaLabel: `Progress of ${code}` }), done: make("span") };
  parts.stop = make("button", { type: "button", onclick: () => socket.send("stop", { code, stopped: parts.stop.dataset.does === "stop" }) });
  const remove = make("button", { type: "button", className: "danger", ariaLabel: `Delete ${code}`, onclick: () => ask(code) }, "Delete");
  parts.element = make("tr", {}, make("th", { scope: "row", className: "code" }, make("a", { href: link }, code)), parts.where,
    make("td", {}, parts.bar, " ", parts.done), parts.there, parts.robot, parts.events, make("td", {}, copy, parts.stop, remove));
  find("people").append(parts.element);
  rows.set(code, parts);
  return parts;
}

function fill(parts, person) {
  const trial = person.kind === "trial" ? `task ${person.trial}: ${person.condition}, ${person.scene}` : KINDS[person.kind];
  const where = person.state === "invited" ? "has not begun" : person.state === "finished" ? "has finished" : trial;
  setText(parts.where, person.state === "stopped" ? `stopped at ${trial}` : where);
  parts.bar.value = person.of ? person.stage / person.of : 0;
  setText(parts.done, person.of ? `${person.stage} of ${person.of}` : "");
  setText(parts.there, person.here ? "yes" : "no");
  const robot = person.robot;
  setText(parts.robot, robot ? robot.note || `${robot.clock.toFixed(0)} s, clock ${robot.rate.toFixed(2)}` : "–");
  const seconds = person.latest ? Math.max(0, Math.round(shown.time - person.latest)) : null;
  setText(parts.events, seconds === null ? "0" : `${person.events}, ${seconds < 120 ? `${seconds} s` : `${Math.round(seconds / 60)} min`} ago`);
  const does = person.state === "stopped" ? "continue" : "stop";
  parts.stop.dataset.does = does;
  parts.stop.hidden = !["active", "stopped"].includes(person.state);
  setText(parts.stop, does === "stop" ? "Stop" : "Let go on");
  parts.stop.setAttribute("aria-label", `${does === "stop" ? "Stop" : "Let go on"} ${person.code}`);
}

async function copied(button, link) {
  await navigator.clipboard.writeText(link);
  setText(button, "Copied");
  setTimeout(() => setText(button, "Copy link"), 1500);
}

function ask(code) {
  doomed = code;
  setText(find("sure-text"), `Everything about ${code} is deleted at once: events, answers and the link. It cannot be brought back.`);
  find("sure").showModal();
}

find("close").addEventListener("click", () => socket.send("close", { closed: shown.open }));
find("sure-no").addEventListener("click", () => find("sure").close());
find("sure-yes").addEventListener("click", () => {
  find("sure").close();
  socket.send("delete", { code: doomed });
});
