// Reward terms over the steps of an episode, as lines.

import { make, setText } from "./dom.js";

const NS = "http://www.w3.org/2000/svg";
const WIDTH = 320, HEIGHT = 120, MOST = 400; // pixels, and points of a line
const DASHES = ["", "6 3", "2 3", "9 3 2 3", "1 5", "12 4"]; // lines differ not only by colour

export class Plot {
  constructor() {
    this.svg = document.createElementNS(NS, "svg");
    this.svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
    this.svg.setAttribute("role", "img");
    this.legend = make("ul", { className: "legend" });
    this.element = make("div", { className: "plot" }, this.svg, this.legend);
    this.clear();
  }

  clear() {
    this.points = [];
    this.lines = {};
    this.svg.replaceChildren();
    this.svg.setAttribute("aria-label", "Sums of reward terms: none yet");
    this.legend.replaceChildren();
  }

  /** Add the sums of the terms at a step of the episode. */
  add(step, rewards) {
    const names = Object.keys(rewards);
    if (!names.length || !step) return;
    const last = this.points.at(-1);
    if (last && (step < last.step || names.join() !== Object.keys(last.rewards).join())) this.clear();
    if (last && step === last.step && this.points.length) return;
    this.points.push({ step, rewards });
    if (this.points.length > MOST) this.points.shift();
    this.draw(names);
  }

  draw(names) {
    const values = this.points.flatMap((point) => Object.values(point.rewards));
    const low = Math.min(0, ...values), high = Math.max(0.001, ...values);
    const first = this.points[0].step, span = Math.max(this.points.at(-1).step - first, 1);
    names.forEach((name, at) => {
      let line = this.lines[name];
      if (!line) {
        line = this.lines[name] = document.createElementNS(NS, "polyline");
        line.setAttribute("class", `line line-${at % 6}`);
        line.setAttribute("stroke-dasharray", DASHES[at % DASHES.length]);
        this.svg.append(line);
        const sample = document.createElementNS(NS, "svg");
        sample.setAttribute("viewBox", "0 0 24 8");
        sample.setAttribute("aria-hidden", "true");
        const stroke = document.createElementNS(NS, "path");
        stroke.setAttribute("d", "M0 4H24");
        stroke.setAttribute("class", `line line-${at % 6}`);
        stroke.setAttribute("stroke-dasharray", DASHES[at % DASHES.length]);
        sample.append(stroke);
        this.legend.append(make("li", {}, sample, make("span")));
      }
      const place = (point) => {
        const x = (WIDTH * (point.step - first)) / span;
        const y = HEIGHT - 4 - ((HEIGHT - 8) * (point.rewards[name] - low)) / (high - low);
        return `${x.toFixed(1)},${y.toFixed(1)}`;
      };
      line.setAttribute("points", this.points.map(place).join(" "));
      setText(this.legend.children[at].lastChild, `${name} ${this.points.at(-1).rewards[name].toFixed(2)}`);
    });
    this.svg.setAttribute("aria-label", `Sums of reward terms over ${this.points.at(-1).step} steps`);
  }
}
