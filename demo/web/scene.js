// The frame with the scene: its look, where the mouse is in it, and keys that move the finger.

import { find } from "./dom.js";

const HOVER_PERIOD = 80; // milliseconds
const KEYS = { ArrowLeft: "left", ArrowRight: "right", ArrowUp: "away", ArrowDown: "near", PageUp: "up", PageDown: "down" };
// Of what the frame shows, only the picture is wanted. Its ground is that of the page.
const STYLE = `
  html, body, #root { background: transparent !important; }
  #root div { background-color: transparent !important; }
  .mantine-Notifications-root, .mantine-Paper-root, .mantine-Modal-root, .mantine-Affix-root { display: none !important; }
  canvas:focus-visible, #root:focus-visible { outline: 3px solid #1c6dd0; outline-offset: -3px; }
`;

export class SceneFrame {
  constructor(number, send) {
    this.frame = find("scene");
    this.send = send;
    this.last = 0;
    this.frame.addEventListener("load", () => this.dress());
    this.frame.src = `scene/${number}/${location.search}`;
  }

  dress() {
    const view = this.frame.contentWindow;
    const style = view.document.createElement("style");
    style.textContent = STYLE;
    view.document.head.append(style);
    view.document.documentElement.lang = "en";
    view.addEventListener("keydown", (event) => {
      const to = KEYS[event.key];
      if (to === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      this.send("nudge", { to });
    }, true);
    view.addEventListener("pointermove", (event) => this.hover(event.buttons, [
      share(event.clientX, view.innerWidth), share(event.clientY, view.innerHeight)]), true);
    view.document.documentElement.addEventListener("pointerleave", () => this.hover(0, null, true));
  }

  hover(buttons, at, now = false) {
    const time = performance.now();
    if (buttons || (!now && time - this.last < HOVER_PERIOD)) return;
    this.last = time;
    this.send("hover", { at });
  }
}

function share(part, whole) {
  return Math.min(Math.max(part / whole, 0), 1);
}
