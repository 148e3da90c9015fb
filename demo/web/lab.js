// The Lab: everything technical, folded away.

import { make, setOptions, setText } from "./dom.js";
import { Plot } from "./plot.js";

const AXES = ["x", "y", "z"];
const ARROWS = { ArrowLeft: "left", ArrowRight: "right", ArrowUp: "away", ArrowDown: "near" };
const MOVES = [
  ["left", "←", "to your left"], ["away", "↑", "away from you"], ["near", "↓", "towards you"], ["right", "→", "to your right"],
];

/** send: sends a message of this tab. speech: has a part of its own. */
export class Lab {
  constructor(panel, send, speech) {
    this.panel = panel;
    this.send = send;
    this.plot = new Plot();
    panel.append(
      make("h2", {}, "Lab"), this.buildThinking(), this.buildComparison(), this.buildRewards(), this.buildClock(),
      this.buildSight(), this.buildObjects(), this.buildHand(), speech.build(), this.buildRecord(), this.buildChoice());
  }

  // ---- What the policy thinks

  buildThinking() {
    this.hears = make("p", { className: "small" });
    this.attention = make("ul", { className: "bars" });
    this.pointing = make("ul", { className: "bars" });
    this.noShares = make("p", { className: "small" }, "Nothing yet: say something.");
    return folder("Attention", true, this.hears, this.noShares,
      make("h3", {}, "The policy's attention"), this.attention, make("h3", {}, "Pointed at"), this.pointing,
      this.flag("glow", "Objects glow by attention"), this.flag("names", "Show all names"));
  }

  showLab(lab) {
    bars(this.attention, lab.names, lab.attention);
    bars(this.pointing, lab.names, lab.pointing);
    const chosen = this.object.value;
    setOptions(this.object, lab.movable.map((index) => [String(index), lab.names[index]]));
    if (lab.movable.includes(Number(chosen || -1))) this.object.value = chosen; // its name may be another one now
    this.noShares.hidden = Boolean(lab.attention || lab.pointing);
    this.plot.add(lab.step, lab.rewards);
    const counts = Object.entries(lab.outcomes).map(([name, count]) => `${name} ${count}`);
    setText(this.outcomes, `So far: ${counts.join(", ") || "nothing"}`);
  }

  // ---- What policy and expert would do now

  buildComparison() {
    this.compares = make("input", { type: "checkbox", onchange: () => this.setFlag("compares", this.compares.checked) });
    this.comparisonHint = make("p", { className: "small" });
    this.intents = make("tbody");
    const heads = ["", "policy", "expert"].map((name) => make("th", { scope: "col" }, name));
    this.table = make("table", { className: "intents" },
      make("caption", {}, "Arrows at the gripper: policy thick and blue, expert thin and orange"),
      make("thead", {}, make("tr", {}, ...heads)), this.intents);
    return folder("Policy and expert", false, make("label", {}, this.compares, " Ask both at every step"),
      this.comparisonHint, this.table);
  }

  showIntents(shown) {
    this.compares.checked = shown.compares;
    const { policy, expert } = shown.of;
    this.table.hidden = !policy;
    const hint = shown.policy ? "Say something: nobody is asked while the robot rests." : "There is no trained policy here.";
    setText(this.comparisonHint, policy || !shown.compares ? "" : hint);
    if (!policy) return;
    const angle = angleBetween(policy.move, expert.move);
    const rows = [
      ...AXES.map((axis, at) => [`move ${axis}, mm`, policy.move[at], expert.move[at]]),
      ["angle between, degrees", angle === null ? "-" : Math.round(angle), ""],
      ...policy.action.map((value, at) => [`action ${at + 1}`, value.toFixed(2), expert.action[at].toFixed(2)]),
    ];
    while (this.intents.children.length > rows.length) this.intents.lastChild.remove();
    rows.forEach((row, at) => {
      let line = this.intents.children[at];
      if (line === undefined) this.intents.append(line = make("tr", {}, make("th", { scope: "row" }), make("td"), make("td")));
      row.forEach((text, column) => setText(line.children[column], String(text)));
    });
  }

  buildRewards() {
    this.outcomes = make("p", { className: "small" });
    return folder("Reward terms", false, this.plot.element, this.outcomes);
  }

  // ---- Clock

  buildClock() {
    this.rate = make("p", { className: "small" });
    this.paused = make("input", { type: "checkbox", onchange: () => this.setFlag("paused", this.paused.checked) });
    this.speed = make("input", { type: "range", min: 0.1, max: 1, step: 0.1, value: 1,
      oninput: () => this.send("speed", { value: Number(this.speed.value) }) });
    this.speedText = make("output", {}, "1");
    const step = make("button", { type: "button", onclick: () => this.press("step") }, "One step");
    return folder("Clock", false, this.rate, make("label", {}, this.paused, " Pause"),
      make("label", { className: "row" }, "Speed", this.speed, this.speedText), step);
  }

  showClock(clock) {
    setText(this.rate, `clock: ${clock.rate.toFixed(2)} of real time`);
    this.paused.checked = clock.paused;
    if (document.activeElement !== this.speed) this.speed.value = clock.speed;
    setText(this.speedText, String(clock.speed));
  }

  // ---- What cameras see

  buildSight() {
    this.looks = make("input", { type: "checkbox", onchange: () => this.setFlag("looks", this.looks.checked) });
    this.camera = make("select", { onchange: () => this.send("camera", { value: this.camera.value }) });
    this.picture = make("img", { alt: "", hidden: true });
    this.seen = make("ul", { className: "small plain" });
    this.sightNote = make("p", { className: "small" });
    return folder("What I see", false, make("label", {}, this.looks, " Look once a second"),
      make("label", { className: "row" }, "Camera", this.camera), this.picture, this.sightNote, this.seen);
  }

  showSight(sight) {
    this.looks.checked = sight.looks;
    setOptions(this.camera, sight.cameras.length ? sight.cameras.map((name) => [name, name]) : [["", "no camera"]]);
    this.camera.value = sight.camera;
    if (sight.picture) this.picture.src = sight.picture;
    if (sight.picture) this.picture.alt = `Camera ${sight.camera}: ${sight.lines.join("; ") || "nothing"}`;
    this.picture.hidden = !sight.looks || !this.picture.src;
    const looking = sight.looking.length ? `${sight.looking.join(" and ")} see:` : "";
    setText(this.sightNote, sight.note || (sight.looks ? looking : "Tick the box to look."));
    this.seen.replaceChildren(...sight.lines.map((line) => make("li", {}, line)));
    this.seen.hidden = !sight.looks;
  }

  // ---- Objects, moved by keys

  buildObjects() {
    this.object = make("select", { ariaLabel: "Object to move" });
    this.moved = make("p", { className: "small", role: "status" });
    const pad = make("div", { className: "pad", role: "group", ariaLabel: "Move the object. Arrow keys do, too" },
      ...MOVES.map(([to, sign, words]) => make("button", {
        type: "button", value: to, ariaLabel: words, title: words, onclick: () => this.moveObject(to) }, sign)));
    pad.addEventListener("keydown", (event) => {
      if (!(event.key in ARROWS) || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      this.moveObject(ARROWS[event.key]);
      pad.querySelector(`[value=${ARROWS[event.key]}]`).focus();
    });
    return folder("Move objects", false, make("label", { className: "row" }, "Object", this.object), pad, this.moved,
      make("p", { className: "small" }, "By 2 cm, or to the next cell of a board. In the picture, drag an object."));
  }

  moveObject(to) {
    if (this.object.value) this.send("move", { object: Number(this.object.value), to });
  }

  // ---- By hand

  buildHand() {
    this.sliders = AXES.map((axis) => make("input", { type: "range", step: 0.01, oninput: () => this.moveHand() }));
    this.closed = make("input", { type: "checkbox", onchange: () => this.setFlag("gripper closed", this.closed.checked) });
    this.handHint = make("p", { className: "small" }, "Choose 'Driven by: my hand'. Arrow and page keys in the picture move the gripper too.");
    return folder("By hand", false, this.handHint,
      ...AXES.map((axis, at) => make("label", { className: "row" }, axis, this.sliders[at])),
      make("label", {}, this.closed, " Gripper closed"));
  }

  moveHand() {
    this.send("hand", { place: this.sliders.map((slider) => Number(slider.value)) });
  }

  showHand(hand) {
    this.sliders.forEach((slider, at) => {
      slider.min = hand.low[at];
      slider.max = hand.high[at];
      slider.disabled = hand.place === null;
      if (hand.place && document.activeElement !== slider) slider.value = hand.place[at];
    });
    this.closed.checked = hand.closed;
    this.closed.disabled = hand.place === null;
  }

  // ---- Pictures and videos

  buildRecord() {
    this.video = make("button", { type: "button", onclick: () => this.press("video") }, "Start video");
    this.link = make("input", { type: "text", readOnly: true, hidden: true, ariaLabel: "Link to this scene" });
    this.linkNote = make("p", { className: "small", role: "status" });
    this.format = make("select", { ariaLabel: "Format of the dataset" });
    setOptions(this.format, [["lerobot", "LeRobot"], ["minari", "Minari"]]);
    this.exports = make("button", { type: "button",
      onclick: () => this.send("export", { kind: this.format.value }) }, "Export");
    return folder("Record", false,
      make("div", { className: "buttons" },
        make("button", { type: "button", onclick: () => this.press("picture") }, "Picture"), this.video,
        make("button", { type: "button", onclick: () => this.press("link") }, "Copy link")),
      this.link, this.linkNote,
      make("div", { className: "buttons" }, this.format, this.exports),
      make("p", { className: "small" }, "Export: what was asked for of this robot and task, and what it did, as a dataset."));
  }

  /** Show the link of the scene, and copy it where the browser lets us. */
  async showLink(code) {
    const address = new URL(`#scene=${code}`, location.href);
    this.link.hidden = false;
    this.link.value = address.href;
    this.link.select();
    let copied = true;
    await (navigator.clipboard?.writeText(address.href) ?? Promise.reject()).catch(() => { copied = false; });
    setText(this.linkNote, copied ? "The link is copied: scene, seed and conversation." : "Copy the link from the field.");
  }

  showExporting(exporting) {
    this.exports.disabled = exporting;
    setText(this.exports, exporting ? "Writing…" : "Export");
  }

  showRecording(recording) {
    setText(this.video, recording ? "Stop video" : "Start video");
  }

  // ---- Robot, task and policy

  buildChoice() {
    this.selects = Object.fromEntries(["robot", "control", "task", "workspace"].map((name) => [name, make("select")]));
    this.objects = make("input", { type: "number", min: 1, max: 6 });
    this.policy = make("select");
    this.run = make("input", { type: "text", maxLength: 500 });
    const rows = Object.entries(this.selects).map(([name, select]) =>
      make("label", { className: "row" }, name[0].toUpperCase() + name.slice(1), select));
    return folder("Robot, task and policy", false, ...rows,
      make("label", { className: "row" }, "Objects", this.objects),
      make("label", { className: "row" }, "Policy", this.policy),
      make("label", { className: "row" }, "or a run folder", this.run),
      make("button", { type: "button", onclick: () => this.change({}) }, "Change"));
  }

  showChoice(choice) {
    for (const [name, select] of Object.entries(this.selects)) {
      setOptions(select, choice.options[name].map((each) => [each, each]));
      select.value = choice.shown[name];
    }
    setOptions(this.policy, [["", "the one that fits"], ...choice.policies.map((each) => [each, each])]);
    this.objects.max = choice.most;
    this.objects.value = choice.shown.objects;
    this.run.value = choice.shown.run;
  }

  /** Ask for the environment that is chosen here, with these values in place of some. */
  change(values) {
    const chosen = Object.fromEntries(Object.entries(this.selects).map(([name, select]) => [name, select.value]));
    const objects = Number(this.objects.value);
    const more = { policy: this.policy.value || null, run: this.run.value.trim() };
    if (objects >= 1 && objects <= Number(this.objects.max)) more.objects = Math.round(objects);
    this.send("change", { ...chosen, ...more, ...values });
  }

  // ---- Small things

  press(button) {
    this.send("click", { button });
  }

  setFlag(name, value) {
    this.send("flag", { name, value });
  }

  flag(name, text) {
    const box = make("input", { type: "checkbox", onchange: () => this.setFlag(name, box.checked) });
    return make("label", {}, box, ` ${text}`);
  }
}

function folder(title, open, ...children) {
  return make("details", { open }, make("summary", {}, title), ...children);
}

/** Degrees between two moves; null if one of them is none. */
function angleBetween(one, other) {
  const length = Math.hypot(...one) * Math.hypot(...other);
  const along = one.reduce((sum, value, at) => sum + value * other[at], 0);
  return length ? (180 / Math.PI) * Math.acos(Math.min(Math.max(along / length, -1), 1)) : null;
}

/** Bars with names and percentages; none for null. */
function bars(list, names, shares) {
  list.hidden = list.previousSibling.hidden = shares === null;
  if (shares === null) return;
  while (list.children.length > names.length) list.lastChild.remove();
  names.forEach((name, at) => {
    let item = list.children[at];
    if (item === undefined) {
      item = make("li", {}, make("span"), make("span", { className: "bar-of" }, make("span")));
      list.append(item);
    }
    setText(item.children[0], `${name}: ${Math.round(100 * shares[at])}%`);
    item.children[1].firstChild.style.width = `${100 * shares[at]}%`;
  });
}
