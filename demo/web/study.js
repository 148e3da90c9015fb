// A participant's page: consent, trials with the robot in a frame, questionnaires, thanks.

import { find, make, setText } from "./dom.js";
import { StudySocket } from "./study_socket.js";

const SAVE = 600; // milliseconds without a key after which free text is saved
const ABOUT = {
  scene: "About the task that you have just done",
  condition: "About the tasks that you have just done",
  study: "About all tasks",
};
const main = find("main");
let shown = { kind: "" };
let drawn = ""; // what the page was built for
let withdrawn = false;
let saving = null; // free text that is being typed

const socket = new StudySocket({
  onShown: show,
  onNote: (text) => note(withdrawn ? "" : text || ""),
  onState: (connected) => note(connected ? "" : "The connection is lost. Trying again; nothing is lost."),
});
const send = (action, fields = {}) => socket.send(action, { stage: shown.stage, ...fields });

function note(text) {
  setText(find("note"), text);
}

function show(now) {
  shown = now;
  const signature = `${now.kind} ${now.stage} ${now.begun ?? ""}`;
  if (signature !== drawn) {
    drawn = signature;
    flush();
    draw();
  }
  if (now.kind === "trial") refresh();
}

function draw() {
  setText(find("title"), shown.title ?? "Study");
  document.title = shown.title ?? "Study";
  const counted = shown.state === "active" && shown.kind !== "stopped";
  setText(find("place"), counted ? `Part ${shown.stage} of ${shown.of - 1}` : "");
  find("withdraw").hidden = !["active", "finished", "stopped"].includes(shown.state) || shown.kind === "consent";
  const build = { consent, trial, questions, thanks, stopped, gone }[shown.kind];
  main.className = shown.kind === "trial" && shown.begun ? "task" : "";
  main.replaceChildren(...build());
  main.querySelector("h2")?.focus();
  window.scrollTo(0, 0);
}

const heading = (text) => make("h2", { tabIndex: -1 }, text);
const prose = (text) => text.trim().split(/\n\s*\n/).map((part) => make("p", {}, part.replace(/\s+/g, " ")));
const sheet = (...children) => [make("div", { className: "sheet" }, ...children)];
const button = (text, onclick, properties = {}) => make("button", { type: "button", onclick, ...properties }, text);

// ---- Consent, thanks, and ends

function consent() {
  const box = make("input", { type: "checkbox", id: "agree" });
  const start = button("Take part", () => (box.checked ? send("consent") : note("Tick the box first if you agree.")), { className: "main" });
  return sheet(
    heading("Your consent"), ...prose(shown.text),
    make("label", { className: "agree" }, box, " I have read this, and I agree to take part."),
    make("div", { className: "buttons" }, start, button("I do not agree", declined)),
  );
}

function declined() {
  main.replaceChildren(...sheet(heading("You do not take part"),
    make("p", {}, "Nothing about you is stored. You can close this page, or load it again if you change your mind.")));
}

const thanks = () => sheet(heading("The end"), ...prose(shown.text), make("p", {}, "Your code: ", make("strong", {}, shown.code)));
const stopped = () => sheet(heading("This is stopped"),
  make("p", {}, "The experimenter has stopped the study. Keep this page open if it is to go on later."));
const gone = () => sheet(heading(withdrawn ? "You have withdrawn" : "Nothing is here"),
  make("p", {}, withdrawn ? "Everything about you is deleted. You can close this page." : shown.text));

// ---- Trials

function pictures() {
  if (!shown.pictures) return null;
  const picture = (name, caption, alt) => make("figure", {},
    make("img", { src: `${encodeURI(shown.pictures)}/${name}.png`, alt, width: 480, height: 360 }),
    make("figcaption", {}, caption));
  return make("div", { className: "pictures" },
    picture("before", "Before", "The table as it is at the beginning"), picture("after", "After", "The table as it shall be at the end"));
}

function trial() {
  const title = `Task ${shown.trial} of ${shown.trials}`;
  if (!shown.begun) {
    return sheet(heading(title), ...prose(shown.text), make("p", { className: "how" }, shown.how), pictures(),
      make("p", { id: "waiting", role: "status" }), make("div", { className: "buttons" },
        button("Begin", () => send("begin"), { id: "begin", className: "main", disabled: true })));
  }
  const aside = make("section", { className: "goal", ariaLabel: "Your task" }, heading(title),
    make("details", { open: window.innerWidth > 900 }, make("summary", {}, "What to do"), ...prose(shown.text),
      make("p", { className: "how" }, shown.how), pictures()),
    make("p", { id: "left", className: "small" }), make("p", { id: "waiting", role: "status" }),
    make("div", { className: "buttons" },
      button("Done", () => send("end"), { className: "main", id: "done" }),
      button("I give up", () => send("end", { gave_up: true }), { id: "give-up" })));
  return [aside, make("iframe", { id: "robot", title: "The robot, and what you tell it" })];
}

/** Show what changes within a trial: whether the robot is there, and the time that is left. */
function refresh() {
  const waiting = shown.reached ? "That is it! You go on in a moment." : shown.note || (shown.ready ? "" : "One moment: the robot is loading.");
  setText(find("waiting"), waiting);
  if (!shown.begun) {
    find("begin").disabled = !shown.ready;
    return;
  }
  const left = Math.max(0, Math.round((shown.seconds - shown.clock) / 10) * 10);
  setText(find("left"), `Time left: about ${left >= 120 ? `${Math.round(left / 60)} minutes` : `${left} seconds`}`);
  const frame = find("robot");
  if (shown.ready && frame.dataset.run !== String(shown.run)) {
    frame.dataset.run = shown.run;
    frame.src = `robot/?run=${shown.run}`;
  }
  frame.classList.toggle("away", !shown.ready);
}

// ---- Questionnaires

function questions() {
  const form = make("form", { noValidate: true }, heading(ABOUT[shown.about]), ...shown.questions.map(question),
    make("div", { className: "buttons" }, make("button", { type: "submit", className: "main" }, "Go on")));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    flush();
    const missing = [...form.querySelectorAll("[data-required]")].find((each) => !given(each));
    for (const each of form.querySelectorAll("[data-required]")) each.classList.toggle("missing", !given(each));
    if (!missing) {
      send("submit");
      return;
    }
    note(`Please answer: ${missing.querySelector("legend, label").textContent}`);
    missing.querySelector("input, textarea").focus();
  });
  return [make("div", { className: "sheet" }, form)];
}

const given = (field) => Boolean(field.querySelector("input:checked") || field.querySelector("textarea")?.value.trim());

function question(asked) {
  const id = `question-${shown.questions.indexOf(asked)}`;
  const text = asked.required ? asked.text : `${asked.text} (optional)`;
  const required = asked.required ? { "data-required": "yes" } : {};
  if (asked.kind === "text") {
    const area = make("textarea", { id, rows: 4, maxLength: 4000, value: asked.value ?? "" });
    area.addEventListener("input", () => save(asked.name, area));
    area.addEventListener("blur", flush);
    return make("div", { className: "question", ...required }, make("label", { htmlFor: id }, text), area);
  }
  const values = asked.kind === "likert" ? Array.from({ length: asked.points }, (_, at) => at + 1) : asked.choices;
  const radios = values.map((value, at) => {
    const ends = asked.kind === "likert" ? { 0: asked.low, [values.length - 1]: asked.high }[at] : undefined;
    const radio = make("input", { type: "radio", name: id, value, checked: asked.value === value,
      onchange: () => send("answer", { question: asked.name, value }) });
    return make("label", {}, radio, make("span", {}, String(value)), ends ? make("span", { className: "hidden" }, `(${ends})`) : null);
  });
  const scale = asked.kind === "likert"
    ? make("div", { className: "likert" }, make("span", { className: "end", ariaHidden: "true" }, asked.low),
      make("div", { className: "points" }, ...radios), make("span", { className: "end", ariaHidden: "true" }, asked.high))
    : make("div", { className: "choices" }, ...radios);
  return make("fieldset", { className: "question", ...required }, make("legend", {}, text), scale);
}

function save(name, area) {
  clearTimeout(saving?.timer);
  saving = { name, area, stage: shown.stage, timer: setTimeout(flush, SAVE) };
}

/** Send the text that is being typed at once. */
function flush() {
  if (!saving) return;
  clearTimeout(saving.timer);
  socket.send("answer", { stage: saving.stage, question: saving.name, value: saving.area.value });
  saving = null;
}

// ---- Withdrawing

find("withdraw").addEventListener("click", () => find("sure").showModal());
find("sure-no").addEventListener("click", () => find("sure").close());
find("sure-yes").addEventListener("click", () => {
  find("sure").close();
  withdrawn = true;
  socket.send("withdraw");
});
