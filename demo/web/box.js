// The box: history by arrow keys, suggestions while typing, and a preview of what is understood.

import { find, make, setText } from "./dom.js";

const MOST_SUGGESTIONS = 6;
const ALWAYS = ["what do you see?", "what can you do?", "undo", "stop", "go home"];

/** say: called with a sentence. preview: called with what is typed so far. */
export class Box {
  constructor(say, preview) {
    this.say = say;
    this.preview = preview;
    this.input = find("say");
    this.list = find("suggestions");
    this.sentences = [];
    this.history = [];
    this.at = 0; // in the history, from its end; 0 is what is being typed
    this.chosen = -1; // of the suggestions
    this.shown = [];
    find("form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.submit();
    });
    this.input.addEventListener("input", () => this.typed());
    this.input.addEventListener("keydown", (event) => this.key(event));
    this.input.addEventListener("blur", () => setTimeout(() => this.suggest([]), 150));
    this.list.addEventListener("pointerdown", (event) => event.preventDefault()); // the box keeps the focus
  }

  /** Take over what can be said in the scene as it is now. */
  offer(sentences) {
    this.sentences = sentences;
    if (this.shown.length) this.typed();
  }

  submit() {
    const sentence = (this.chosen >= 0 ? this.shown[this.chosen] : this.input.value).trim();
    if (!sentence || !document.body.dataset.ready) return; // while the robot loads, the words stay in the box
    if (this.history.at(-1) !== sentence) this.history.push(sentence);
    this.at = 0;
    this.input.value = "";
    this.suggest([]);
    this.showPreview(null);
    this.say(sentence);
    this.input.focus();
  }

  typed() {
    const text = this.input.value;
    this.at = 0;
    this.preview(text);
    if (!text.trim()) this.showPreview(null);
    this.suggest(text.trim() ? matching([...this.sentences, ...ALWAYS, ...this.history], text) : []);
  }

  key(event) {
    const { key } = event;
    if (key === "Escape") {
      this.suggest([]);
    } else if (key === "Tab" && !event.shiftKey && this.chosen >= 0) {
      event.preventDefault();
      this.fill(this.shown[this.chosen]);
    } else if (key === "ArrowDown" || key === "ArrowUp") {
      event.preventDefault();
      if (this.shown.length) this.choose(this.chosen + (key === "ArrowDown" ? 1 : -1));
      else this.recall(key === "ArrowUp" ? 1 : -1);
    }
  }

  recall(step) {
    if (step < 0 && this.at === 0) {
      this.suggest([...this.sentences, ...ALWAYS].slice(0, MOST_SUGGESTIONS));
      return;
    }
    this.at = Math.min(Math.max(this.at + step, 0), this.history.length);
    this.fill(this.at ? this.history.at(-this.at) : "");
  }

  fill(text) {
    this.input.value = text;
    this.suggest([]);
    this.preview(text);
  }

  choose(at) {
    this.chosen = at < -1 ? this.shown.length - 1 : at >= this.shown.length ? -1 : at;
    [...this.list.children].forEach((item, index) => item.setAttribute("aria-selected", index === this.chosen));
    if (this.chosen >= 0) this.input.setAttribute("aria-activedescendant", `suggestion-${this.chosen}`);
    else this.input.removeAttribute("aria-activedescendant");
  }

  suggest(sentences) {
    this.shown = sentences;
    this.list.replaceChildren(...sentences.map((sentence, index) => make("li", {
      id: `suggestion-${index}`, role: "option", ariaSelected: "false", onclick: () => {
        this.chosen = index;
        this.submit();
      },
    }, sentence)));
    this.list.hidden = !sentences.length;
    this.input.setAttribute("aria-expanded", Boolean(sentences.length));
    this.choose(-1);
  }

  /** Show how the typed words are understood; null: nothing is typed. */
  showPreview(preview) {
    const line = find("preview");
    const shown = preview && this.input.value.trim() ? preview : null;
    line.className = `preview ${shown ? shown.kind : ""}`;
    const signs = { plan: "✓ ", question: "? ", answer: "", refusal: "… " };
    setText(line, shown ? signs[shown.kind] + shown.text : "");
  }
}

/** The sentences that have all words that are typed, each as a beginning of one of theirs; the best ones first. */
function matching(sentences, text) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const found = [...new Set(sentences)].filter((sentence) => {
    const own = sentence.toLowerCase().split(/[\s?]+/);
    return sentence.toLowerCase() !== text.toLowerCase().trim() && words.every((word) => own.some((each) => each.startsWith(word)));
  });
  const begins = (sentence) => (sentence.toLowerCase().startsWith(text.toLowerCase()) ? 0 : 1);
  return found.sort((a, b) => begins(a) - begins(b)).slice(0, MOST_SUGGESTIONS);
}
