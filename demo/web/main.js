// The page: connects the socket with the conversation, the box, the scene and the Lab.

import { Box } from "./box.js";
import { Conversation } from "./conversation.js";
import { find, make, setOptions, setText } from "./dom.js";
import { Lab } from "./lab.js";
import { SceneFrame } from "./scene.js";
import { Socket } from "./socket.js";
import { Speech } from "./speech.js";

const number = [...crypto.getRandomValues(new Uint8Array(8))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
const send = (action, fields) => socket.send(action, fields);
const say = (text) => send("say", { text });
const press = (button) => send("click", { button });
const box = new Box(say, (text) => send("preview", { text }));
const conversation = new Conversation(find("log"), (offer) => {
  say(offer);
  find("say").focus();
});
const speech = new Speech(box, send);
const lab = new Lab(find("lab"), send, speech);
let read = -1; // number of the newest entry that was read aloud

const DRIVERS = { policy: "Trained policy", expert: "Scripted expert", hand: "You" };
const SHOW = {
  status: showStatus,
  choice: showChoice,
  sayable: showSayable,
  speech: (shown) => speech.show(shown),
  heard: (heard) => speech.heard(heard),
  preview: (preview) => box.showPreview(preview),
  lab: (shown) => lab.showLab(shown),
  clock: (clock) => lab.showClock(clock),
  sight: (sight) => lab.showSight(sight),
  intents: (intents) => lab.showIntents(intents),
  moved: (text) => setText(lab.moved, text),
  hand: (hand) => lab.showHand(hand),
  link: (code) => lab.showLink(code),
  exporting: (exporting) => lab.showExporting(exporting),
  recording: (recording) => lab.showRecording(recording),
  download: (path) => {
    const link = make("a", { href: path, download: path.split("/").at(-1) });
    document.body.append(link);
    link.click();
    link.remove();
  },
};

function onSections(sections) {
  for (const [name, value] of Object.entries(sections)) {
    if (name.startsWith("entry ")) {
      conversation.show(name, value);
      readAloud(name, value);
    } else {
      SHOW[name]?.(value);
    }
  }
}

/** Read what the robot answers, each entry once; not those of before the page was opened. */
function readAloud(name, entry) {
  const number = Number(name.split(" ")[1]);
  if (!entry || number <= read) return;
  read = number;
  if (document.body.dataset.ready) speech.read(entry.text || entry.understood);
}

function onState(connected) {
  if (connected) {
    conversation.clear(); // it is sent anew
  } else {
    delete document.body.dataset.ready; // words stay in the box until they can be sent
    cover("The connection is lost. Trying again.");
  }
}

function cover(text) {
  setText(find("cover"), text);
  find("cover").hidden = !text;
}

function showStatus(status) {
  if (status.loading) {
    cover("One moment: the robot is loading.");
    return;
  }
  cover("");
  document.body.dataset.ready = "yes";
  openLinked();
  setText(find("now"), status.busy ? `${DRIVERS[status.acting]}: ${status.text.replace("Doing: ", "")}` : "");
  setText(lab.hears, status.hears ? `the policy hears: "${status.hears}"` : "");
  const driver = find("bar-driver");
  driver.value = status.driver;
  driver.querySelector('[value="policy"]').disabled = !status.policy;
  driver.title = status.note;
  for (const radio of document.querySelectorAll("[name=viewpoint]")) radio.checked = radio.value === status.viewpoint;
  document.querySelector("fieldset.left").title = status.left;
  find("point").hidden = !status.person;
  find("arm").hidden = !status.real && !status.arm;
  find("arm-stop").hidden = !status.real;
  find("arm-release").hidden = !status.stopped;
  setText(find("arm-note"), status.arm);
}

function showChoice(choice) {
  lab.showChoice(choice);
  for (const name of ["robot", "task"]) {
    const select = find(`bar-${name}`);
    setOptions(select, choice.options[name].map((each) => [each, each.replaceAll("_", " ")]));
    select.value = choice.shown[name];
  }
  showScenes(choice);
}

/** Put the prepared scenes before the tasks. */
function showScenes(choice) {
  const select = find("bar-task");
  if (!select.querySelector("optgroup")) {
    const scenes = choice.scenes.map(([name, title]) => make("option", { value: `scene:${name}` }, title));
    const tasks = [...select.children];
    select.replaceChildren(make("optgroup", { label: "Prepared scenes" }, ...scenes),
      make("optgroup", { label: "Tasks" }, ...tasks));
  }
  select.value = choice.shown.scene ? `scene:${choice.shown.scene}` : choice.shown.task;
}

/** Ask for the scene that the address names, once. */
function openLinked() {
  const { hash, pathname, search } = location;
  if (!hash.startsWith("#scene=") || !document.body.dataset.ready) return;
  history.replaceState(null, "", pathname + search);
  send("scene", { text: hash.slice("#scene=".length) });
}

function showSayable(sentences) {
  box.offer(sentences);
  find("chips").replaceChildren(...sentences.map((sentence) => make("li", {},
    make("button", { type: "button", className: "chip", onclick: () => say(sentence) }, sentence))));
}

find("stop").addEventListener("click", () => press("stop"));
find("shuffle").addEventListener("click", () => press("shuffle"));
find("point").addEventListener("click", () => press("point"));
find("arm-stop").addEventListener("click", () => press("stop arm"));
find("arm-release").addEventListener("click", () => press("release arm"));
find("bar-driver").addEventListener("change", (event) => send("driver", { value: event.target.value }));
for (const name of ["robot", "task"]) {
  find(`bar-${name}`).addEventListener("change", (event) => {
    const [kind, scene] = event.target.value.split(":");
    if (scene) {
      send(kind, { text: scene });
      return;
    }
    const others = { policy: null, run: "", control: "step" };
    if (name === "task") others.workspace = null;
    if (name === "task") others.objects = null;
    lab.change({ ...others, [name]: event.target.value });
  });
}
for (const radio of document.querySelectorAll("[name=viewpoint]")) {
  radio.addEventListener("change", () => send("viewpoint", { value: radio.value }));
}
addEventListener("hashchange", openLinked);
find("lab-button").addEventListener("click", (event) => {
  const panel = find("lab");
  panel.hidden = !panel.hidden;
  event.currentTarget.setAttribute("aria-expanded", !panel.hidden);
});

const socket = new Socket(`socket/${number}`, onSections, onState);
new SceneFrame(number, send);
find("say").focus();
