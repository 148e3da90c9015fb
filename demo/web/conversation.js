// The log: what was said, what was understood, the steps with their states, and what came of it.

import { make, setText } from "./dom.js";

const MARKS = { // of steps: a sign, and what a screen reader says
  next: ["○", "next"],
  doing: ["▶", "doing"],
  done: ["✓", "done"],
  failed: ["✗", "failed"],
  dropped: ["–", "dropped"],
};
const KINDS = { plan: "", answer: "", question: "It asks: ", refusal: "Not possible: ", note: "" };

export class Conversation {
  constructor(log, onOffer) {
    this.log = log;
    this.onOffer = onOffer;
    this.items = new Map();
    this.view = log.parentElement;
    this.follows = true; // the newest turn, until a person scrolls back
    this.size = ""; // of the view, when it last followed
    this.view.addEventListener("scroll", () => {
      if (this.size !== sizeOf(this.view)) return; // a new size moved it, not a person
      this.follows = this.view.scrollHeight - this.view.scrollTop - this.view.clientHeight < 60;
    });
    new ResizeObserver(() => this.follow()).observe(this.view);
  }

  follow() {
    this.size = sizeOf(this.view);
    if (this.follows) this.view.scrollTop = this.view.scrollHeight;
  }

  clear() {
    this.log.replaceChildren();
    this.items.clear();
  }

  /** Show an entry; null takes it away. */
  show(name, entry) {
    const old = this.items.get(name);
    if (entry === null) {
      old?.remove();
      this.items.delete(name);
      return;
    }
    if (old === undefined) {
      const item = make("li", { className: `entry ${entry.kind}` });
      this.fill(item, entry);
      this.items.set(name, item);
      const after = [...this.items.keys()].filter((other) => order(other) > order(name)).sort((a, b) => order(a) - order(b));
      this.log.insertBefore(item, after.length ? this.items.get(after[0]) : null);
    } else {
      this.fill(old, entry);
    }
    this.follows ||= old === undefined;
    this.follow();
  }

  /** Change only what is new: what stays is not read again. */
  fill(item, entry) {
    const parts = item.parts ??= this.build(item, entry);
    setText(parts.text, entry.text);
    const plain = entry.steps.length > 0 && entry.steps.every((step) => entry.understood.includes(step.words));
    setText(parts.understood, plain ? "" : entry.understood);
    setText(parts.result, entry.result);
    parts.result.className = entry.result.startsWith("Done") ? "result good" : "result";
    showSteps(parts.steps, entry.steps);
    const signature = JSON.stringify(entry.offers);
    if (parts.offers.dataset.of !== signature) {
      parts.offers.dataset.of = signature;
      parts.offers.replaceChildren(...entry.offers.map((offer) =>
        make("button", { type: "button", className: "chip", onclick: () => this.onOffer(offer) }, offer)));
    }
  }

  build(item, entry) {
    if (entry.said.length) {
      const words = entry.said.map(([text, kind]) => (kind ? make("mark", { className: kind }, text) : text));
      item.append(make("p", { className: "said" }, make("span", { className: "hidden" }, "You: "), ...words));
    }
    const parts = {
      understood: make("p", { className: "understood" }),
      steps: make("ul", { className: "steps" }),
      text: make("span"),
      offers: make("div", { className: "offers" }),
      result: make("p", { className: "result" }),
    };
    const label = KINDS[entry.kind] ? make("span", { className: "hidden" }, KINDS[entry.kind]) : null;
    item.append(make("div", { className: "reply" },
      parts.understood, parts.steps, make("p", { className: "text" }, label, parts.text), parts.offers, parts.result));
    return parts;
  }
}

function order(name) {
  return Number(name.split(" ")[1]);
}

const sizeOf = (view) => `${view.clientWidth} ${view.clientHeight}`;

function showSteps(list, steps) {
  while (list.children.length > steps.length) list.lastChild.remove();
  steps.forEach((step, at) => {
    const [sign, word] = MARKS[step.state];
    let item = list.children[at];
    if (item === undefined) {
      item = make("li", {}, make("span", { ariaHidden: "true" }), make("span"), make("span", { className: "hidden" }));
      list.append(item);
    }
    item.className = step.state;
    setText(item.children[0], `${sign} `);
    setText(item.children[1], step.words);
    setText(item.children[2], `: ${word}`);
  });
}
